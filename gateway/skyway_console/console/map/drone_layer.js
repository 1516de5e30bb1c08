// Draws the drones on a canvas above the map, so that they move without drawing the map again.

import {colours} from "./colours.js";

// A reading is shown this much later, so that drones glide between two readings.
const GLIDE_MS = 1_000;
const LOW_CHARGE = 0.2;
const NEAR_PX = 14;
const BESIDE_PX = 8;

export class DroneLayer {
  constructor(map) {
    this.map = map;
    this.canvas = document.createElement("canvas");
    this.canvas.className = "drone-layer";
    map.getCanvasContainer().append(this.canvas);
    this.tracks = new Map();
    this.selected = null;
    this.stations = [];
    this.frames = 0;
    this.isGone = false;
    const draw = (at) => {
      if (this.isGone) return;
      this.draw(at);
      requestAnimationFrame(draw);
    };
    requestAnimationFrame(draw);
  }

  remove() {
    this.isGone = true;
    this.canvas.remove();
  }

  // The drones of the live picture; each glides from where it is drawn to its new place.
  show(drones) {
    const now = performance.now();
    const tracks = new Map();
    for (const [droneId, drone] of Object.entries(drones)) {
      const before = this.tracks.get(droneId);
      const hasMoved = before?.drone.position !== drone.position;
      const from = before ? placeOf(before, now) : drone.position;
      tracks.set(droneId, hasMoved ? {drone, from, since: now} : {...before, drone});
    }
    this.tracks = tracks;
  }

  // What is nearest to this place of the screen: {droneId}, {stationId}, or {} if nothing is near.
  whatIsAt(point) {
    const now = performance.now();
    const drones = [...this.tracks].map(
      ([droneId, track]) => [{droneId}, this.pointOf(track, now)]);
    const stations = this.stations.map(
      ({stationId, position}) => [{stationId}, this.map.project(position)]);
    return nearest(point, [...drones, ...stations]);
  }

  // Where a drone is drawn: one that stands is beside its station, whose colour is seen then.
  pointOf(track, now) {
    const {x, y} = this.map.project(placeOf(track, now));
    const aside = track.drone.activity === "FLYING" ? 0 : BESIDE_PX;
    return {x: x + aside, y: y - aside};
  }

  draw(now) {
    this.frames += 1;
    const context = this.fit();
    const paint = colours();
    const {width, height} = this.map.getContainer().getBoundingClientRect();
    this.drawNames(context, paint);
    for (const [droneId, track] of this.tracks) {
      const {x, y} = this.pointOf(track, now);
      if (x < -20 || y < -20 || x > width + 20 || y > height + 20) continue;
      if (droneId === this.selected) drawRing(context, x, y, paint.selected);
      if (track.drone.faults?.length) drawRing(context, x, y, paint.full);
      drawDrone(context, x, y, track.drone, paint);
    }
  }

  fit() {
    const {clientWidth, clientHeight} = this.map.getContainer();
    const ratio = devicePixelRatio || 1;
    const [width, height] = [clientWidth * ratio, clientHeight * ratio];
    if (this.canvas.width !== width || this.canvas.height !== height) {
      Object.assign(this.canvas, {width, height});
      Object.assign(this.canvas.style, {width: `${clientWidth}px`, height: `${clientHeight}px`});
    }
    const context = this.canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, clientWidth, clientHeight);
    return context;
  }

  drawNames(context, paint) {
    const zoom = this.map.getZoom();
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "center";
    for (const {name, position, isFirst} of this.stations) {
      if (zoom < 9 && !isFirst) continue;
      const {x, y} = this.map.project(position);
      context.strokeStyle = paint.halo;
      context.lineWidth = 3;
      context.strokeText(name, x, y - 10);
      context.fillStyle = paint.text;
      context.fillText(name, x, y - 10);
    }
  }
}

// The nearest of some things at their points, [thing, {x, y}]; {} if none is near.
function nearest({x, y}, things) {
  let [found, least] = [{}, NEAR_PX];
  for (const [thing, point] of things) {
    const distance = Math.hypot(point.x - x, point.y - y);
    if (distance <= least) [found, least] = [thing, distance];
  }
  return found;
}

function placeOf({drone, from, since}, now) {
  const share = Math.min(1, (now - since) / GLIDE_MS);
  const [longitude, latitude] = drone.position;
  return [from[0] + (longitude - from[0]) * share, from[1] + (latitude - from[1]) * share];
}

function drawRing(context, x, y, colour) {
  context.beginPath();
  context.arc(x, y, 13, 0, 2 * Math.PI);
  context.strokeStyle = colour;
  context.lineWidth = 3;
  context.stroke();
}

// An arrow in the drone's heading while it flies, a square while it stands.
function drawDrone(context, x, y, drone, paint) {
  const isFlying = drone.activity === "FLYING";
  context.save();
  context.translate(x, y);
  context.beginPath();
  if (isFlying) {
    context.rotate(((drone.heading_deg ?? 0) * Math.PI) / 180);
    context.moveTo(0, -10);
    context.lineTo(7, 8);
    context.lineTo(0, 4);
    context.lineTo(-7, 8);
  } else {
    context.rect(-4, -4, 8, 8);
  }
  context.closePath();
  const isLow = drone.soc < LOW_CHARGE && isFlying;
  context.fillStyle = isLow ? paint.low : drone.mission_id ? paint.drone : paint.idle;
  context.fill();
  context.strokeStyle = paint.halo;
  context.lineWidth = 1.5;
  context.stroke();
  context.restore();
}
