// Stations as they are drawn, each look once: a ring whose arc shows the free pads of all.

// Half of a picture's width and height, in pixels.
export const STATION_HALF_PX = 16;

const pictures = new Map();

// How far a station reaches from its middle at a zoom, in pixels.
export const stationRadius = (zoom) => Math.min(11, Math.max(3, 3 + (zoom - 6.5) * 1.7));

// `state` is free, busy, full, congested, closed or parking (features.js).
export function stationPicture({state, pads, taken}, radius, paint) {
  const size = Math.round(radius);
  const key = `${state} ${pads} ${taken} ${size} ${paint.halo} ${devicePixelRatio}`;
  if (!pictures.has(key)) pictures.set(key, drawn(state, pads, taken, size, paint));
  return pictures.get(key);
}

function drawn(state, pads, taken, radius, paint) {
  const canvas = document.createElement("canvas");
  const size = 2 * STATION_HALF_PX * devicePixelRatio;
  Object.assign(canvas, {width: size, height: size});
  const context = canvas.getContext("2d");
  context.scale(devicePixelRatio, devicePixelRatio);
  context.translate(STATION_HALF_PX, STATION_HALF_PX);
  if (state === "parking") drawParking(context, radius, paint);
  else if (state === "closed") drawClosed(context, radius, paint);
  else drawPads(context, {state, pads, taken, radius}, paint);
  return canvas;
}

function disc(context, radius, colour) {
  context.beginPath();
  context.arc(0, 0, radius, 0, 2 * Math.PI);
  context.fillStyle = colour;
  context.fill();
}

function arc(context, radius, from, to, colour, width) {
  context.beginPath();
  context.arc(0, 0, radius, from - Math.PI / 2, to - Math.PI / 2);
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.stroke();
}

// Free pads are the coloured part of the ring, and at a near zoom their number.
function drawPads(context, {state, pads, taken, radius}, paint) {
  const turn = 2 * Math.PI;
  const width = Math.max(2, radius * 0.32);
  const free = Math.max(0, pads - taken);
  const colour = {full: paint.full, congested: paint.busy}[state] ?? paint.free;
  disc(context, radius + 1.5, paint.halo);
  disc(context, radius, paint.ring);
  arc(context, radius - width / 2, 0, turn, state === "full" ? paint.full : paint.rest, width);
  if (state === "congested") context.setLineDash([2.5, 2]);
  if (free > 0) arc(context, radius - width / 2, 0, (turn * free) / pads, colour, width);
  context.setLineDash([]);
  if (radius < 9) {
    disc(context, Math.max(1, radius * 0.3), colour);
    return;
  }
  context.fillStyle = state === "full" ? paint.full : paint.text;
  context.font = "600 9px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(free, 0, 0.5);
}

function drawClosed(context, radius, paint) {
  disc(context, radius + 1.5, paint.halo);
  disc(context, radius, paint.closed);
  const end = radius * 0.42;
  context.strokeStyle = paint.ring;
  context.lineWidth = Math.max(1.5, radius * 0.22);
  context.beginPath();
  for (const side of [-1, 1]) {
    context.moveTo(-end * side, -end);
    context.lineTo(end * side, end);
  }
  context.stroke();
}

// A station without pads: drones land and wait there, and cannot charge.
function drawParking(context, radius, paint) {
  const half = radius * 0.7;
  context.beginPath();
  context.roundRect(-half, -half, 2 * half, 2 * half, 2);
  context.fillStyle = paint.ring;
  context.fill();
  context.strokeStyle = paint.closed;
  context.lineWidth = 1.5;
  context.stroke();
}
