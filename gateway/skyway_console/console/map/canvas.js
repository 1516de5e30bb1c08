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

const widths = new Map();

// Measured once: a label is drawn on each frame of a move.
export function textWidth(context, text) {
  const key = `${context.font} ${text}`;
  if (!widths.has(key)) widths.set(key, context.measureText(text).width);
  return widths.get(key);
}
