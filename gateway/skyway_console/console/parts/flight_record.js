// What drones measured in a past hour, and where each was at a moment of it.

import {all, get, part} from "../api.js";
import {isOperator, session} from "../session.js";

const MOST_DRONES = 300;
// Samples of so long before the span say where drones were when it began.
const BEFORE_MS = 1_800_000;
const AT_ONCE = 6;
// A drone that has moved less than this between two samples stands, in degrees: about 10 m.
const STILL_DEG = 1e-4;

export const isStill = ([west, south], [east, north]) =>
  Math.max(Math.abs(east - west), Math.abs(north - south)) < STILL_DEG;

async function readDrones() {
  if (isOperator()) return all("/v1/drones", MOST_DRONES);
  const provider = session.value.subject_id;
  const drones = await all(`/v1/providers/${part(provider)}/drones`, MOST_DRONES);
  return drones.map((drone) => ({...drone, provider_id: provider}));
}

async function readSamples({drone_id: drone, provider_id: provider}, {from, until}) {
  const span = `from=${new Date(from - BEFORE_MS).toISOString()}&until=${new Date(until).toISOString()}`;
  const path = `/v1/providers/${part(provider)}/drones/${part(drone)}/telemetry`;
  const {items} = await get(`${path}?${span}&resolution=auto&limit=2000`);
  return items.filter(({position}) => position)
    .map(({at, position, soc}) => ({atMs: Date.parse(at), position, soc}));
}

// The samples of each drone that measured something in the span, by its id, the oldest first.
export async function readRecord(span, onProgress) {
  const drones = await readDrones();
  const record = new Map();
  let done = 0;
  const waiting = [...drones];
  const work = async () => {
    for (let drone = waiting.shift(); drone; drone = waiting.shift()) {
      const samples = await readSamples(drone, span);
      if (samples.length) record.set(drone.drone_id, samples);
      onProgress((done += 1), drones.length);
    }
  };
  await Promise.all(Array.from({length: AT_ONCE}, work));
  return {record, isCut: drones.length >= MOST_DRONES};
}

// The number of the last sample that is not after a moment; -1 before the first.
function lastNotAfter(samples, atMs) {
  let [low, high] = [-1, samples.length - 1];
  while (low < high) {
    const middle = Math.ceil((low + high) / 2);
    if (samples[middle].atMs <= atMs) low = middle;
    else high = middle - 1;
  }
  return low;
}

function headingDeg([west, south], [east, north]) {
  const narrowing = Math.cos((south * Math.PI) / 180);
  return (Math.atan2((east - west) * narrowing, north - south) * 180) / Math.PI;
}

// A drone as the map draws it, between two of its samples.
function droneBetween(before, after, atMs) {
  if (!after) return {position: before.position, soc: before.soc, activity: "IDLE", faults: []};
  const share = (atMs - before.atMs) / (after.atMs - before.atMs);
  const between = (one, other) => one + (other - one) * share;
  // The place after it, beside the place before: a drone crosses longitude 180 the short way.
  const [east, north] = after.position;
  const there = [east + 360 * Math.round((before.position[0] - east) / 360), north];
  const isFlying = !isStill(before.position, there);
  return {
    position: before.position.map((each, axis) => between(each, there[axis])),
    soc: between(before.soc, after.soc),
    activity: isFlying ? "FLYING" : "IDLE",
    heading_deg: headingDeg(before.position, there),
    mission_id: isFlying ? "then" : undefined,
    faults: [],
  };
}

// All drones of a record at a moment, by their ids.
export function dronesAt(record, atMs) {
  const drones = {};
  for (const [droneId, samples] of record) {
    const last = lastNotAfter(samples, atMs);
    if (last >= 0) drones[droneId] = droneBetween(samples[last], samples[last + 1], atMs);
  }
  return drones;
}
