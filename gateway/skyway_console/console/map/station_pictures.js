// Stations as they are drawn, each look once: a ring whose arc shows the free pads of all.

import {circle, drawnPicture, fill, stroke, writeCentred} from "./canvas.js";

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

const drawn = (state, pads, taken, radius, paint) => drawnPicture(STATION_HALF_PX, (context) => {
  if (state === "parking") drawParking(context, radius, paint);
  else if (state === "closed") drawClosed(context, radius, paint);
  else drawPads(context, {state, pads, taken, radius}, paint);
});

function disc(context, radius, colour) {
  circle(context, [0, 0], radius);
  fill(context, colour);
}

function arc(context, radius, from, to, colour, width) {
  context.beginPath();
  context.arc(0, 0, radius, from - Math.PI / 2, to - Math.PI / 2);
  stroke(context, colour, width);
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
  writeCentred(context, free, [0, 0], "600 9px", state === "full" ? paint.full : paint.text);
}

function drawClosed(context, radius, paint) {
  disc(context, radius + 1.5, paint.halo);
  disc(context, radius, paint.closed);
  const end = radius * 0.42;
  context.beginPath();
  for (const side of [-1, 1]) {
    context.moveTo(-end * side, -end);
    context.lineTo(end * side, end);
  }
  stroke(context, paint.ring, Math.max(1.5, radius * 0.22));
}

// A station without pads: drones land and wait there, and cannot charge.
function drawParking(context, radius, paint) {
  const half = radius * 0.7;
  context.beginPath();
  context.roundRect(-half, -half, 2 * half, 2 * half, 2);
  fill(context, paint.ring);
  stroke(context, paint.closed, 1.5);
}
