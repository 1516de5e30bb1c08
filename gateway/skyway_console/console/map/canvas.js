// A canvas above the map, as large as the map, in pixels of the page.

export function addCanvas(map, name) {
  const canvas = document.createElement("canvas");
  canvas.className = `map-canvas ${name}`;
  map.getCanvasContainer().append(canvas);
  return canvas;
}

// The cleared canvas, ready to draw on, and its size.
export function fitted(canvas, map) {
  const {clientWidth, clientHeight} = map.getContainer();
  const ratio = devicePixelRatio || 1;
  const [width, height] = [Math.round(clientWidth * ratio), Math.round(clientHeight * ratio)];
  if (canvas.width !== width || canvas.height !== height) {
    Object.assign(canvas, {width, height});
    Object.assign(canvas.style, {width: `${clientWidth}px`, height: `${clientHeight}px`});
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, clientWidth, clientHeight);
  return {context, width: clientWidth, height: clientHeight};
}

// A picture that is drawn once and copied often: `draw` gets a context whose middle is at [0, 0].
export function drawnPicture(half, draw) {
  const canvas = document.createElement("canvas");
  const size = 2 * half * devicePixelRatio;
  Object.assign(canvas, {width: size, height: size});
  const context = canvas.getContext("2d");
  context.scale(devicePixelRatio, devicePixelRatio);
  context.translate(half, half);
  draw(context);
  return canvas;
}

export const drawPicture = (context, picture, [x, y], half) =>
  context.drawImage(picture, x - half, y - half, 2 * half, 2 * half);

export function circle(context, [x, y], radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
}

export function fill(context, colour) {
  context.fillStyle = colour;
  context.fill();
}

export function stroke(context, colour, width) {
  Object.assign(context, {strokeStyle: colour, lineWidth: width});
  context.stroke();
}

export function writeCentred(context, text, [x, y], font, colour) {
  Object.assign(context, {font: `${font} system-ui, sans-serif`, fillStyle: colour, textAlign: "center", textBaseline: "middle"});
  context.fillText(text, x, y + 0.5);
}

const widths = new Map();

// Measured once: a label is drawn on each frame of a move.
export function textWidth(context, text) {
  const key = `${context.font} ${text}`;
  if (!widths.has(key)) widths.set(key, context.measureText(text).width);
  return widths.get(key);
}
