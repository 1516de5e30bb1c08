// Small pictures of drones, each drawn once: copying them is much faster than drawing shapes.

// Half of a picture's width and height, in pixels.
export const HALF_PX = 12;

const LOW_CHARGE = 0.2;
// Headings differ by so much at least, in degrees.
const TURN_DEG = 5;

// The corners of a drone that flies north, and of one that stands, from the picture's middle.
const ARROW = [[0, -10], [7, 8], [0, 4], [-7, 8]];
const SQUARE = [[-4, -4], [4, -4], [4, 4], [-4, 4]];

const pictures = new Map();

// A drone as it is drawn: an arrow in its heading while it flies, a square while it stands.
export function dronePicture(drone, paint) {
  const isFlying = drone.activity === "FLYING";
  const turn = isFlying ? Math.round((drone.heading_deg ?? 0) / TURN_DEG) * TURN_DEG : 0;
  const colour = colourOf(drone, isFlying, paint);
  const key = `${colour} ${paint.halo} ${isFlying} ${turn} ${devicePixelRatio}`;
  if (!pictures.has(key)) pictures.set(key, drawn(isFlying ? ARROW : SQUARE, turn, colour, paint.halo));
  return pictures.get(key);
}

function colourOf(drone, isFlying, paint) {
  if (isFlying && drone.soc < LOW_CHARGE) return paint.low;
  return drone.mission_id ? paint.drone : paint.idle;
}

function drawn(corners, turn, colour, halo) {
  const canvas = document.createElement("canvas");
  const size = 2 * HALF_PX * devicePixelRatio;
  Object.assign(canvas, {width: size, height: size});
  const context = canvas.getContext("2d");
  context.scale(devicePixelRatio, devicePixelRatio);
  context.translate(HALF_PX, HALF_PX);
  context.rotate((turn * Math.PI) / 180);
  context.beginPath();
  corners.forEach(([x, y]) => context.lineTo(x, y));
  context.closePath();
  context.fillStyle = colour;
  context.fill();
  context.strokeStyle = halo;
  context.lineWidth = 1.5;
  context.stroke();
  return canvas;
}
