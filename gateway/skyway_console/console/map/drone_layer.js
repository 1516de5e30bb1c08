// Draws the drones on a canvas above the map, so that they move without drawing the map again.

import {fleetNow, fleetRate} from "../fleet_clock.js";
import {airframe} from "./airframes.js";
import {addCanvas, circle, drawPicture, fill, fitted, stroke, textWidth} from "./canvas.js";
import {clustersOf, drawCluster} from "./clusters.js";
import {colours, onThemeChange} from "./colours.js";
import {Track, isOld} from "./drone_motion.js";
import {HALF_PX, SMALL_HALF_PX, dronePicture, smallPicture} from "./drone_pictures.js";
import {boxesAround} from "./label_space.js";
import {screenOf} from "./mercator.js";
import {packagesAboard} from "./packages_aboard.js";
import {stationRadius} from "./station_pictures.js";

const NEAR_PX = 18;
const RING_PX = 22;
const OUTSIDE_PX = 24;
// Below this zoom drones that are near each other are one count.
const CLUSTERS_BELOW_ZOOM = 7;
// More drones than that are drawn small, without names and trails.
const MOST_WHOLE = 150;
const NAMES_FROM_ZOOM = 9.8;
const MOST_NAMES = 60;
// The next frame comes when the fastest drone has moved this far, and each second at least.
const STEP_PX = 0.35;
// Drones are smaller where the map shows a whole region.
const sizeAt = (zoom) => Math.min(1, Math.max(0.62, 0.62 + (zoom - 7) * 0.19));
const FRAME_MS = 16;
const LONGEST_MS = 1_000;

export class DroneLayer {
  // `nameOf` is called with a drone's id and the name that it has; `stations` is the layer below.
  constructor(map, stations, {isLive = false, nameOf = (droneId) => droneId} = {}) {
    Object.assign(this, {map, stations, isLive, nameOf});
    this.canvas = addCanvas(map, "drone-layer");
    this.tracks = new Map();
    this.aboard = new Map();
    this.seen = [];
    this.clusters = [];
    this.isGone = false;
    this.selected = null;
    this.hovered = null;
    this.frames = 0;
    this.asked = null;
    this.later = null;
    map.on("move", () => this.draw());
    map.on("resize", () => this.ask());
    this.leaveTheme = onThemeChange(() => this.ask());
    this.ask();
  }

  remove() {
    this.leaveTheme();
    cancelAnimationFrame(this.asked);
    clearTimeout(this.later);
    this.isGone = true;
    this.canvas.remove();
  }

  // Draw with the next frame. While nothing moves, little is drawn.
  ask() {
    if (this.isGone || this.asked !== null) return;
    clearTimeout(this.later);
    this.asked = requestAnimationFrame(() => {
      this.asked = null;
      this.draw();
    });
  }

  // The drones of the live picture, and what they fly.
  show(drones, missions = {}) {
    const reading = {nowMs: fleetNow(), wallMs: performance.now(), isLive: this.isLive};
    const tracks = new Map();
    for (const [droneId, drone] of Object.entries(drones)) {
      const track = this.tracks.get(droneId) ?? new Track(drone, reading.nowMs);
      const landing = drone.next_landing && this.stations.placeOf(drone.next_landing.station_id);
      track.read(drone, {...reading, landing});
      tracks.set(droneId, track);
    }
    this.tracks = tracks;
    const standing = Object.values(drones).filter(({activity}) => activity !== "FLYING");
    this.stations.keepFree(standing.map(({station_id: stationId}) => stationId).filter(Boolean));
    this.aboard = packagesAboard(missions);
    this.ask();
  }

  select(droneId) {
    this.selected = droneId;
    this.ask();
  }

  hover(droneId) {
    if (this.hovered === droneId) return;
    this.hovered = droneId;
    this.ask();
  }

  // What is nearest to this place of the screen: {droneId}, {stationId}, {cluster}, or {}.
  whatIsAt(point) {
    const toScreen = screenOf(this.map);
    const stations = this.stations.stations.map(({stationId, at}) => [{stationId}, toScreen(at)]);
    const clusters = this.clusters.map((cluster) => [{cluster}, cluster.point]);
    const drones = this.clusters.length ? [] : this.seen.map(({droneId, point: at}) => [{droneId}, at]);
    return nearest(point, [...clusters, ...drones, ...stations]);
  }

  draw() {
    if (this.isGone) return;
    this.frames += 1;
    const {context, width, height} = fitted(this.canvas, this.map);
    const frame = {
      context, paint: colours(), zoom: this.map.getZoom(), toScreen: screenOf(this.map),
      nowMs: fleetNow(), wallMs: performance.now(), rate: fleetRate(), width, height,
    };
    this.seen = this.seenIn(frame);
    this.clusters = frame.zoom < CLUSTERS_BELOW_ZOOM
      ? clustersOf(this.seen).filter(({droneIds}) => droneIds.length > 1) : [];
    const grouped = new Set(this.clusters.flatMap(({droneIds}) => droneIds));
    const alone = this.seen.filter(({droneId}) => !grouped.has(droneId) || droneId === this.selected);
    const isWhole = alone.length <= MOST_WHOLE;
    for (const each of alone) {
      if (isWhole || each.droneId === this.selected) this.drawTrail(frame, each);
    }
    for (const each of alone) {
      if (isWhole || each.droneId === this.selected) this.drawDrone(frame, each);
      else this.drawSmall(frame, each);
    }
    for (const cluster of this.clusters) drawCluster(context, cluster, frame.paint);
    this.drawNames(frame, alone, isWhole);
    this.askAgain(frame);
  }

  // What is on the screen: [{droneId, track, point}]. Drones that stand are around their station.
  seenIn({toScreen, nowMs, wallMs, zoom, width, height}) {
    const standing = new Map();
    const seen = [];
    for (const [droneId, track] of this.tracks) {
      let [x, y] = toScreen(track.placeAt(nowMs, wallMs));
      if (track.drone.activity !== "FLYING") {
        const number = standing.get(track.drone.station_id) ?? 0;
        standing.set(track.drone.station_id, number + 1);
        const angle = Math.PI * (0.25 + number * 0.3);
        const away = stationRadius(zoom) + 8;
        [x, y] = [x + Math.sin(angle) * away, y - Math.cos(angle) * away];
      }
      const isOutside = x < -OUTSIDE_PX || y < -OUTSIDE_PX || x > width + OUTSIDE_PX || y > height + OUTSIDE_PX;
      if (!isOutside) seen.push({droneId, track, point: [x, y]});
    }
    return seen;
  }

  isOld({track: {drone}}, {nowMs, rate}) {
    return this.isLive && isOld(drone, nowMs, rate);
  }

  lookOf(each, frame) {
    const {drone} = each.track;
    return {
      airframe: airframe(drone.model_id), isFlying: drone.activity === "FLYING", heading: drone.heading_deg,
      soc: drone.soc, isBusy: Boolean(drone.mission_id), packages: this.aboard.get(drone.mission_id) ?? 0,
      isOld: this.isOld(each, frame),
    };
  }

  drawDrone(frame, each) {
    const {context, paint} = frame;
    if (each.droneId === this.selected) drawRing(context, each.point, paint.selected);
    if (each.track.drone.faults?.length) drawRing(context, each.point, paint.full);
    drawPicture(context, dronePicture(this.lookOf(each, frame), paint), each.point, HALF_PX * sizeAt(frame.zoom));
  }

  drawSmall(frame, each) {
    const picture = smallPicture(each.track.drone, this.isOld(each, frame), frame.paint);
    drawPicture(frame.context, picture, each.point.map(wholePixels), SMALL_HALF_PX);
  }

  // Where it was in the last minutes: the older, the fainter.
  drawTrail({context, paint, toScreen}, {droneId, track: {trail, drone}, point}) {
    if (drone.activity !== "FLYING" && droneId !== this.selected) return;
    const points = [...trail.map(([x, y]) => toScreen([x, y])), ...(drone.activity === "FLYING" ? [point] : [])];
    context.strokeStyle = paint.trail;
    context.lineWidth = droneId === this.selected ? 3.5 : 2.5;
    context.lineCap = "butt";
    for (let number = 1; number < points.length; number += 1) {
      context.globalAlpha = 0.6 * (number / points.length) ** 1.5;
      context.beginPath();
      context.moveTo(...points[number - 1]);
      context.lineTo(...points[number]);
      context.stroke();
    }
    context.globalAlpha = 1;
  }

  // Names where they are free of all others: of the drone that is open or pointed at, and of all from near.
  drawNames({context, paint, zoom}, alone, isWhole) {
    const isAsked = ({droneId}) => droneId === this.selected || droneId === this.hovered;
    const isNear = isWhole && zoom >= NAMES_FROM_ZOOM;
    const named = [...alone.filter(isAsked), ...(isNear ? alone.filter((each) => !isAsked(each)) : [])];
    if (named.length === 0) return;
    const space = this.stations.space.copy();
    for (const {point: [x, y]} of isWhole ? alone : named) space.take([x - 13, y - 13, x + 13, y + 13]);
    context.font = "600 12px system-ui, sans-serif";
    context.textBaseline = "middle";
    context.textAlign = "center";
    for (const each of named.slice(0, MOST_NAMES)) {
      const name = this.nameOf(each.droneId, each.track.drone.name);
      const width = textWidth(context, name) + 12;
      const boxes = [0, 14, 28].flatMap((more) => boxesAround(each.point, width, 18, RING_PX - 2 + more));
      const box = space.takeFirst(isAsked(each) ? boxes : boxes.slice(0, 4));
      if (box) drawName(context, name, box, each.droneId === this.selected ? paint.selected : paint.drone, paint);
    }
  }

  // Frames follow the drones: many while they cross the screen, few while they creep.
  askAgain({wallMs, rate, zoom}) {
    let fastest = 0;
    for (const {track} of this.seen) fastest = Math.max(fastest, track.speed(rate, wallMs));
    const stepMs = STEP_PX / (fastest * 512 * 2 ** zoom);
    if (stepMs <= FRAME_MS) this.ask();
    else if (this.asked === null) {
      clearTimeout(this.later);
      this.later = setTimeout(() => this.ask(), Math.min(stepMs, LONGEST_MS));
    }
  }
}

// The nearest of some things at their points, [thing, [x, y]]; {} if none is near.
function nearest({x, y}, things) {
  let [found, least] = [{}, NEAR_PX];
  for (const [thing, [left, top]] of things) {
    const distance = Math.hypot(left - x, top - y);
    if (distance < least) [found, least] = [thing, distance];
  }
  return found;
}

// Between pixels of the screen a picture is filtered while it is copied, which takes twice as long.
const wholePixels = (length) => Math.round(length * devicePixelRatio) / devicePixelRatio;

function drawRing(context, point, colour) {
  circle(context, point, RING_PX);
  stroke(context, colour, 3);
}

function drawName(context, name, [left, top, right, bottom], colour, paint) {
  context.beginPath();
  context.roundRect(left, top, right - left, bottom - top, 5);
  fill(context, colour);
  context.fillStyle = paint.halo;
  context.fillText(name, (left + right) / 2, (top + bottom) / 2 + 0.5);
}
