// Where labels may stand: a label takes its box, and no other label or mark is drawn over it. Who asks
// first has the place, so what matters more asks earlier.

const CELL_PX = 64;
const GAP_PX = 2;

export class LabelSpace {
  constructor() {
    this.cells = new Map();
  }

  // A box is [left, top, right, bottom] in pixels.
  isFree(box) {
    return !this.keysOf(box).some((key) => this.cells.get(key)?.some((other) => overlap(box, other)));
  }

  take(box) {
    for (const key of this.keysOf(box)) {
      if (!this.cells.has(key)) this.cells.set(key, []);
      this.cells.get(key).push(box);
    }
  }

  // The first of some boxes that is free, which is taken then; undefined if none is.
  takeFirst(boxes) {
    const box = boxes.find((each) => this.isFree(each));
    if (box) this.take(box);
    return box;
  }

  copy() {
    const made = new LabelSpace();
    made.cells = new Map([...this.cells].map(([key, boxes]) => [key, [...boxes]]));
    return made;
  }

  keysOf([left, top, right, bottom]) {
    const keys = [];
    for (let x = Math.floor(left / CELL_PX); x <= Math.floor(right / CELL_PX); x += 1) {
      for (let y = Math.floor(top / CELL_PX); y <= Math.floor(bottom / CELL_PX); y += 1) keys.push(`${x} ${y}`);
    }
    return keys;
  }
}

const overlap = (one, other) => one[0] < other[2] + GAP_PX && other[0] < one[2] + GAP_PX
  && one[1] < other[3] + GAP_PX && other[1] < one[3] + GAP_PX;

// Boxes around a mark in the order in which labels try them: above, right, left, below.
export function boxesAround([x, y], width, height, distance) {
  const [half, up] = [width / 2, height / 2];
  return [
    [x - half, y - distance - height, x + half, y - distance],
    [x + distance, y - up, x + distance + width, y + up],
    [x - distance - width, y - up, x - distance, y + up],
    [x - half, y + distance, x + half, y + distance + height],
  ];
}
