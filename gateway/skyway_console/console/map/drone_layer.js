// Draws the drones on a canvas above the map, so that they move without drawing the map again.

import {colours, onThemeChange} from "./colours.js";
import {HALF_PX, dronePicture} from "./drone_pictures.js";
import {mercator, screenOf} from "./mercator.js";

// A reading is shown this much later, so that drones glide between two readings.
const GLIDE_MS = 1_000;
const NEAR_PX = 14;
const BESIDE_PX = 8;
const RING_PX = 13;
const OUTSIDE_PX = 20;

// People who ask their system for less motion see drones go from reading to reading.
const lessMotion = matchMedia("(prefers-reduced-motion: reduce)");

export class DroneLayer {
  constructor(map) {
    this.map = map;
    this.canvas = document.createElement("canvas");
    this.canvas.className = "drone-layer";
    map.getCanvasContainer().append(this.canvas);
    this.tracks = new Map();
    this.isGone = false;
    this.selected = null;
    this.stations = [];
    this.frames = 0;
    this.movesUntil = 0;
    this.asked = null;
    map.on("move", () => this.ask());
    map.on("resize", () => this.ask());
    this.leaveTheme = onThemeChange(() => this.ask());
    this.ask();
  }

  remove() {
    this.leaveTheme();
    cancelAnimationFrame(this.asked);
    this.asked = null;
    this.isGone = true;
    this.canvas.remove();
  }

  // Draw soon, and again as long as a drone glides. While nothing moves, nothing is drawn.
  ask() {
    if (this.isGone || this.asked !== null) return;
    this.asked = requestAnimationFrame((now) => {
      this.asked = null;
      this.draw(now);
      if (now < this.movesUntil) this.ask();
    });
  }

  // The drones of the live picture; each glides from where it is drawn to its new place.
  show(drones) {
    const now = performance.now();
    const tracks = new Map();
    for (const [droneId, drone] of Object.entries(drones)) {
      const before = this.tracks.get(droneId);
      if (before?.drone.position === drone.position) {
        tracks.set(droneId, {...before, drone});
      } else {
        const to = mercator(drone.position);
        const glides = before && !lessMotion.matches;
        tracks.set(droneId, {drone, from: glides ? placeOf(before, now) : to, to, since: now});
        if (glides) this.movesUntil = now + GLIDE_MS;
      }
    }
    this.tracks = tracks;
    this.ask();
  }

  select(droneId) {
    this.selected = droneId;
    this.ask();
  }

  showNames(stations) {
    this.stations = stations;
    this.ask();
  }

  // What is nearest to this place of the screen: {droneId}, {stationId}, or {} if nothing is near.
  whatIsAt(point) {
    const now = performance.now();
    const toScreen = screenOf(this.map);
    const drones = [...this.tracks].map(
      ([droneId, track]) => [{droneId}, pointOf(track, toScreen, now)]);
    const stations = this.stations.map(
      ({stationId, position}) => [{stationId}, toScreen(mercator(position))]);
    return nearest(point, [...drones, ...stations]);
  }

  draw(now) {
    this.frames += 1;
    const context = this.fit();
    const paint = colours();
    const toScreen = screenOf(this.map);
    this.drawNames(context, paint, toScreen);
    const {clientWidth: width, clientHeight: height} = this.map.getContainer();
    for (const [droneId, track] of this.tracks) {
      const [x, y] = pointOf(track, toScreen, now);
      const isOutside = x < -OUTSIDE_PX || y < -OUTSIDE_PX
        || x > width + OUTSIDE_PX || y > height + OUTSIDE_PX;
      if (isOutside) continue;
      if (droneId === this.selected) drawRing(context, x, y, paint.selected);
      if (track.drone.faults?.length) drawRing(context, x, y, paint.full);
      const [left, top] = [x - HALF_PX, y - HALF_PX];
      context.drawImage(dronePicture(track.drone, paint), left, top, 2 * HALF_PX, 2 * HALF_PX);
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

  drawNames(context, paint, toScreen) {
    const zoom = this.map.getZoom();
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "center";
    context.lineWidth = 3;
    context.strokeStyle = paint.halo;
    context.fillStyle = paint.text;
    for (const {name, position, isFirst} of this.stations) {
      if (zoom < 9 && !isFirst) continue;
      const [x, y] = toScreen(mercator(position));
      context.strokeText(name, x, y - 10);
      context.fillText(name, x, y - 10);
    }
  }
}

// The nearest of some things at their points, [thing, [x, y]]; {} if none is near.
function nearest({x, y}, things) {
  let [found, least] = [{}, NEAR_PX];
  for (const [thing, [left, top]] of things) {
    const distance = Math.hypot(left - x, top - y);
    if (distance <= least) [found, least] = [thing, distance];
  }
  return found;
}

// Where a drone is between its last two places, in Mercator's coordinates.
function placeOf({from, to, since}, now) {
  const share = Math.min(1, (now - since) / GLIDE_MS);
  return [from[0] + (to[0] - from[0]) * share, from[1] + (to[1] - from[1]) * share];
}

// Where a drone is drawn: one that stands is beside its station, whose colour is seen then.
function pointOf(track, toScreen, now) {
  const [x, y] = toScreen(placeOf(track, now));
  const aside = track.drone.activity === "FLYING" ? 0 : BESIDE_PX;
  return [x + aside, y - aside];
}

function drawRing(context, x, y, colour) {
  context.beginPath();
  context.arc(x, y, RING_PX, 0, 2 * Math.PI);
  context.strokeStyle = colour;
  context.lineWidth = 3;
  context.stroke();
}
