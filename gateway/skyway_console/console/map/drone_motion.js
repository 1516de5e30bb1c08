// Where a drone is between its readings: it flies on as it flew, and a new reading bends its way without
// a jump. A drone that lands next does not fly beyond its landing.

import {mercator} from "./mercator.js";

// How long the difference between what was drawn and a new reading takes to go away.
const GLIDE_MS = 1_000;
// A drone is drawn ahead of its last reading for so long at most, in times of its last gap.
const MOST_GAPS = 3;
const TRAIL_MS = 8 * 60_000;
const TRAIL_POINTS = 60;

// People who ask their system for less motion see drones go from reading to reading.
const lessMotion = matchMedia("(prefers-reduced-motion: reduce)");

const isFlying = ({activity}) => activity === "FLYING";
const minus = ([x, y], [left, top]) => [x - left, y - top];

export class Track {
  constructor(drone, nowMs) {
    this.drone = drone;
    this.place = mercator(drone.position);
    // Of the last reading: fleet time in ms.
    this.atMs = Date.parse(drone.at) || nowMs;
    this.perMs = [0, 0];
    this.gapMs = 0;
    this.error = [0, 0];
    this.since = -Infinity;
    this.trail = [[...this.place, this.atMs]];
  }

  // Another reading of the drone. `landing` is the place where it lands next, in Mercator's coordinates.
  // `isLive` is false where readings are shown as they come, such as in a replay.
  read(drone, {nowMs, wallMs, landing, isLive}) {
    const isNews = this.drone.position !== drone.position || isFlying(this.drone) !== isFlying(drone);
    this.drone = drone;
    this.landing = landing;
    if (!isNews) return;
    const shown = this.placeAt(nowMs, wallMs);
    const place = mercator(drone.position);
    const atMs = Date.parse(drone.at) || nowMs;
    const gapMs = atMs - this.atMs;
    if (isLive && isFlying(drone) && gapMs > 0) {
      this.perMs = minus(place, this.place).map((each) => each / gapMs);
      this.gapMs = gapMs;
    } else {
      this.perMs = [0, 0];
    }
    this.place = place;
    this.atMs = atMs;
    this.since = wallMs;
    this.error = [0, 0];
    this.error = lessMotion.matches ? [0, 0] : minus(shown, this.placeAt(nowMs, wallMs));
    this.trail = [...this.trail, [...place, atMs]]
      .filter(([, , ms]) => Math.abs(atMs - ms) < TRAIL_MS).slice(-TRAIL_POINTS);
  }

  // The place at a moment of fleet time and of this page's clock, in Mercator's coordinates.
  placeAt(nowMs, wallMs) {
    const ahead = lessMotion.matches ? 0
      : Math.min(Math.max(0, nowMs - this.atMs), MOST_GAPS * this.gapMs) * this.shareToLanding(nowMs);
    const rest = Math.max(0, 1 - (wallMs - this.since) / GLIDE_MS);
    const [x, y] = this.place;
    return [x + this.perMs[0] * ahead + this.error[0] * rest, y + this.perMs[1] * ahead + this.error[1] * rest];
  }

  // How much of the way ahead is flown before the landing: all of it while the landing is far.
  shareToLanding(nowMs) {
    if (!this.landing) return 1;
    const [way, left] = [Math.hypot(...this.perMs) * Math.min(nowMs - this.atMs, MOST_GAPS * this.gapMs),
      Math.hypot(...minus(this.landing, this.place))];
    return way > left ? left / way : 1;
  }

  // How much of the world's width it moves in a millisecond of this page's clock.
  speed(rate, wallMs) {
    const glides = wallMs - this.since < GLIDE_MS ? Math.hypot(...this.error) / GLIDE_MS : 0;
    return Math.hypot(...this.perMs) * rate + glides;
  }
}

// Seconds of this page's clock without a reading, after which a drone in flight may be elsewhere.
const OLD_S = 20;

// Whether nobody knows where it is now. Drones that stand report rarely: their state says when they are
// gone. Fleet time may run faster than this page's clock.
export function isOld(drone, nowMs, rate) {
  if (drone.state === "OFFLINE") return true;
  return isFlying(drone) && nowMs - Date.parse(drone.at) > OLD_S * 1_000 * Math.max(1, rate);
}
