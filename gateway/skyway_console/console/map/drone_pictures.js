// Small pictures of drones, each drawn once: copying them is much faster than drawing shapes.

import {circle, drawnPicture, fill, stroke, writeCentred} from "./canvas.js";

// Half of a picture's width and height, in pixels: of a drone with its ring, and of one among many.
export const HALF_PX = 22;
export const SMALL_HALF_PX = 8;

const LOW_CHARGE = 0.2;
const SOON_LOW_CHARGE = 0.4;
// Headings differ by so much at least, in degrees, and charges by so much.
const TURN_DEG = 5;
const CHARGES = 16;
// More pictures than that are forgotten: another theme or screen makes them anew.
const MOST_PICTURES = 4_000;

// The corners of a small drone that flies north, and of one that stands.
const ARROW = [[0, -7], [5, 6], [0, 3], [-5, 6]];
const SQUARE = [[-3, -3], [3, -3], [3, 3], [-3, 3]];

const pictures = new Map();

// `look` is {airframe, isFlying, heading, soc, isBusy, packages, isOld}.
export function dronePicture(look, paint) {
  const turn = look.isFlying ? (Math.round((look.heading ?? 0) / TURN_DEG) * TURN_DEG) % 360 : 0;
  const charge = Math.round((look.soc ?? 0) * CHARGES) / CHARGES;
  const colour = look.isBusy ? paint.drone : paint.idle;
  const ring = look.soc < LOW_CHARGE ? paint.low : look.soc < SOON_LOW_CHARGE ? paint.busy : paint.free;
  const key = `${look.airframe} ${look.isFlying} ${turn} ${charge} ${ring} ${colour} ${look.packages} ${
    look.isOld} ${paint.halo} ${devicePixelRatio}`;
  return kept(key, HALF_PX, (context) => drawWhole(context, {...look, turn, charge, colour, ring}, paint));
}

// By theme and screen: the pictures of many drones by a number, which is found faster than a text.
let small = {paint: null, ratio: 0, pictures: new Map()};

// One of many drones: its heading and whether its charge is low.
export function smallPicture({activity, soc, heading_deg: heading, mission_id: missionId}, isOld, paint) {
  if (small.paint !== paint || small.ratio !== devicePixelRatio) {
    small = {paint, ratio: devicePixelRatio, pictures: new Map()};
  }
  const isFlying = activity === "FLYING";
  const turn = isFlying ? Math.round((heading ?? 0) / TURN_DEG) % (360 / TURN_DEG) : 0;
  const meaning = isFlying && soc < LOW_CHARGE ? 0 : missionId ? 1 : 2;
  const key = ((turn * 3 + meaning) * 2 + Number(isFlying)) * 2 + Number(isOld);
  if (!small.pictures.has(key)) {
    const colour = [paint.low, paint.drone, paint.idle][meaning];
    small.pictures.set(key, drawnPicture(SMALL_HALF_PX, (context) => {
      if (isOld) context.globalAlpha = 0.4;
      context.rotate((turn * TURN_DEG * Math.PI) / 180);
      path(context, isFlying ? ARROW : SQUARE);
      paintShape(context, colour, paint.halo, 1);
    }));
  }
  return small.pictures.get(key);
}

function kept(key, half, draw) {
  if (pictures.has(key)) return pictures.get(key);
  if (pictures.size >= MOST_PICTURES) pictures.clear();
  pictures.set(key, drawnPicture(half, draw));
  return pictures.get(key);
}

function drawWhole(context, {airframe, isFlying, turn, charge, colour, ring, packages, isOld}, paint) {
  const scale = isFlying ? 1 : 0.7;
  if (isOld) context.globalAlpha = 0.45;
  context.save();
  context.scale(scale, scale);
  circle(context, [0, 0], 16.5);
  fill(context, paint.halo);
  drawRing(context, charge, ring, paint, isOld);
  context.rotate((turn * Math.PI) / 180);
  if (isFlying) drawNose(context, colour, paint);
  circle(context, [0, 0], 12);
  fill(context, colour);
  if (airframe === "wings") drawWings(context, paint.halo);
  else drawRotors(context, airframe, paint.halo);
  context.restore();
  if (packages > 0) drawCount(context, packages, scale, paint);
}

// The charge from the top, clockwise.
function drawRing(context, charge, colour, paint, isOld) {
  circle(context, [0, 0], 14.6);
  if (isOld) context.setLineDash([2, 3]);
  stroke(context, paint.rest, 2.6);
  context.setLineDash([]);
  context.beginPath();
  context.arc(0, 0, 14.6, -Math.PI / 2, 2 * Math.PI * charge - Math.PI / 2);
  stroke(context, colour, 2.6);
}

function drawRotors(context, count, colour) {
  const reach = count === 4 ? 6.2 : 7;
  const size = {4: 3, 6: 2.3, 8: 1.9}[count];
  for (let number = 0; number < count; number += 1) {
    const angle = ((number + 0.5) * 2 * Math.PI) / count;
    const [x, y] = [Math.sin(angle) * reach, -Math.cos(angle) * reach];
    context.beginPath();
    context.moveTo(0, 0);
    context.lineTo(x, y);
    stroke(context, colour, 1.8);
    circle(context, [x, y], size);
    stroke(context, colour, 1.5);
  }
  context.beginPath();
  context.roundRect(-2.4, -3.2, 4.8, 6.4, 2);
  fill(context, colour);
}

function drawWings(context, colour) {
  path(context, [[0, -9], [1.8, -3], [10, 1.5], [10, 3.6], [1.6, 2.4], [1.2, 6.5], [4, 8.4], [4, 9.6], [0, 8.8],
    [-4, 9.6], [-4, 8.4], [-1.2, 6.5], [-1.6, 2.4], [-10, 3.6], [-10, 1.5], [-1.8, -3]]);
  fill(context, colour);
}

// A beak on the ring, in the direction of flight.
function drawNose(context, colour, paint) {
  path(context, [[0, -20.5], [5.6, -12.5], [0, -13], [-5.6, -12.5]]);
  paintShape(context, colour, paint.halo, 1.2);
}

function drawCount(context, packages, scale, paint) {
  const point = [13 * scale, -13 * scale];
  circle(context, point, 6.5);
  paintShape(context, paint.text, paint.halo, 1.5);
  writeCentred(context, packages > 9 ? "9+" : packages, point, "700 9px", paint.halo);
}

function path(context, corners) {
  context.beginPath();
  corners.forEach(([x, y]) => context.lineTo(x, y));
  context.closePath();
}

function paintShape(context, colour, halo, width) {
  fill(context, colour);
  stroke(context, halo, width);
}
