// The rows of the schedule: drones with their missions, or pads with what is booked on them.

import {all, get, part, spanQuery} from "../api.js";
import {droneName} from "../drone_names.js";
import {picture} from "../live.js";
import {allStationIds} from "../networks.js";
import {isOperator, session} from "../session.js";
import {stateName} from "../state_words.js";
import {shortId, stationName} from "../words.js";
import {plannedCharge} from "./planned_charge.js";

const MOST_ROWS = 200;
const MOST_PADS = 40;
const MOST_MISSIONS = 200;
const PLANS_EVERY_MS = 30_000;
const LATE_MS = 60_000;

async function readProviders() {
  if (!isOperator()) return [session.value.subject_id];
  return (await all("/v1/providers")).map(({provider_id}) => provider_id);
}

// The plans of missions, by their ids. They are read again when there is another mission or plan, but not
// every few seconds, because they are long.
const plans = {of: "", readMs: 0, byId: {}};

async function readPlans() {
  const of = Object.entries(picture.missions.value).map(([id, {revision}]) => `${id} ${revision}`).sort().join();
  if (of !== plans.of && Date.now() - plans.readMs > PLANS_EVERY_MS) {
    const missions = await all("/v1/missions", MOST_MISSIONS);
    Object.assign(plans, {of, readMs: Date.now(), byId: Object.fromEntries(missions.map((each) => [each.mission_id, each]))});
  }
  return plans.byId;
}

export async function readDrones(span) {
  const items = [];
  for (const provider of await readProviders()) {
    if (items.length >= MOST_ROWS) break;
    items.push(...await all(`/v1/providers/${part(provider)}/schedule?${spanQuery(span.from, span.to)}`, MOST_ROWS));
  }
  const missions = items.length ? await readPlans().catch(() => ({})) : {};
  return items.slice(0, MOST_ROWS).map((each) => droneRow(each, missions))
    .sort((one, other) => one.name.localeCompare(other.name, [], {numeric: true}));
}

// "p1, p2 → Kirby".
function packagesText(live, mission, to) {
  const ids = Object.keys(live?.packages ?? {});
  const known = ids.length ? ids : (mission?.packages ?? []).map(({package_id: id}) => id);
  return `${known.sort().join(", ")} → ${stationName(to)}`;
}

// A promise of a mission, and whether its package comes in time.
const promisesOf = (live) => Object.entries(live?.promises ?? {}).map(([packageId, promised]) => ({
  packageId, at: Date.parse(promised), isMissed: Date.parse(live.packages?.[packageId]) - Date.parse(promised) > LATE_MS,
}));

function missionBars({mission_id: id, delivery_id: delivery, state, service, standby}, missions) {
  const live = picture.missions.value[id];
  const [start, served] = [Date.parse(service.start_at), Date.parse(service.served_at)];
  const bar = {
    id, start, end: served, kind: state, href: ["deliveries", delivery],
    name: packagesText(live, missions[id], service.to_station_id),
    way: `${stationName(service.from_station_id)} to ${stationName(service.to_station_id)}`,
    state: live?.is_held ? "Held" : stateName("mission", state), promises: promisesOf(live),
  };
  const until = standby && Date.parse(standby.until_at);
  if (!(until > served)) return [bar];
  return [bar, {id: `${id} standby`, start: served, end: until, kind: "standby", promises: [],
    name: "way home or standby", way: `from ${stationName(service.to_station_id)}`, state: "Gives way to a mission"}];
}

function droneRow({drone_id: id, entries}, missions) {
  const drone = picture.drones.value[id];
  const planned = entries.map(({mission_id: missionId}) => missions[missionId])
    .filter((mission) => mission?.plan).flatMap(plannedCharge).map(([seconds, soc]) => [seconds * 1_000, soc]);
  return {
    id, name: droneName(id), href: ["map", "drone", id], soc: drone?.soc,
    bars: entries.flatMap((entry) => missionBars(entry, missions)),
    charge: planned.sort(([one], [other]) => one - other),
  };
}

export async function readPads(span) {
  const busy = (await allStationIds()).filter((id) => picture.stations.value[id]).slice(0, MOST_PADS);
  const schedules = await Promise.all(
    busy.map((id) => get(`/v1/stations/${part(id)}/schedule?${spanQuery(span.from, span.to)}`)));
  return schedules.flatMap(({station_id: station, pads}) => pads
    .filter(({entries}) => entries.length > 0)
    .map(({pad, entries}) => ({
      id: `${station} ${pad}`,
      name: `${stationName(station)}, pad ${pad}`,
      href: ["map", "station", station],
      charge: [],
      bars: entries.map((entry) => padBar(entry, station, pad)),
    })));
}

function padBar({start_at: start, end_at: end, mission_id: id}, station, pad) {
  const live = picture.missions.value[id];
  const drone = live && droneName(live.drone_id);
  return {
    id: `${pad} ${start}`, start: Date.parse(start), end: Date.parse(end), kind: "taken", promises: [],
    href: live && ["deliveries", live.delivery_id],
    name: drone ?? "taken", way: `pad ${pad} of ${stationName(station)}`,
    state: id ? `Booked for mission ${shortId(id)}` : "Taken",
  };
}
