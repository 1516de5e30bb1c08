// An operator's day: what needs somebody now, and how deliveries, drones, pads and services are.

import {get, spanQuery} from "../api.js";
import {hasBegun} from "../closed.js";
import {fleetNow, ticks} from "../fleet_clock.js";
import {silentServices} from "../freshness.js";
import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {openAlarms, picture} from "../live.js";
import {pathTo} from "../routes.js";
import {session} from "../session.js";
import {useRead} from "../use_read.js";
import {clockTime, distanceText, durationText} from "../words.js";
import {isLate} from "./delivery_packages.js";
import {Bars, DAY_MARKS, Heat, SplitBar, hoursOfToday} from "./home_charts.js";
import {AlarmsTile, DronesTile, PromisesTile, WorkTile, useDeliveriesToday} from "./home_fleet.js";
import {Tile} from "./tile.js";

const HOUR_MS = 3_600_000;
const PADS_AGAIN_MS = 60_000;
const MINUTES = [5, 15, 60];
const AGE_KINDS = ["fine", "accent", "warn", "danger"];

const running = () => Object.values(picture.deliveries.value);
const isRunningLate = ({packages}) => Object.values(packages).some(isLate);
const waitingS = ({created_at: since}) => (fleetNow() - Date.parse(since)) / 1000;

const count = (number, one, many) => `${number} ${number === 1 ? one : many}`;

const isStopped = () =>
  Object.values(picture.closures.value).some((each) => each.kind === "GROUND_STOP" && hasBegun(each));

const MOST_LATE_SHOWN = 3;

// Where somebody can do something about a late delivery: at its drone, if it has one.
function lateText([deliveryId, {mission_ids: missionIds, reference}]) {
  const droneId = missionIds.map((each) => picture.missions.value[each]?.drone_id).find(Boolean);
  const name = reference ?? "a delivery";
  return droneId ? [`${droneName(droneId)} is late with ${name}`, "map", "drone", droneId]
    : [`${reference ?? "A delivery"} is late and has no drone`, "deliveries", deliveryId];
}

// The late deliveries, each with where to go.
function late() {
  const found = Object.entries(picture.deliveries.value).filter(([, each]) => isRunningLate(each));
  const more = found.length - MOST_LATE_SHOWN;
  return [...found.slice(0, MOST_LATE_SHOWN).map(lateText),
    more > 0 && [count(more, "more delivery is late", "more deliveries are late"), "deliveries"]];
}

// What needs somebody: each a sentence and where to go.
function needs() {
  const urgent = openAlarms.value.filter(({level}) => level !== "WARNING").length;
  const old = running().filter((each) => each.is_waiting && waitingS(each) > 900).length;
  return [
    urgent && [count(urgent, "urgent alarm is open", "urgent alarms are open"), "alarms"],
    ...late(),
    old && [`${count(old, "request has", "requests have")} waited for a drone for more than 15 min`, "schedule"],
    isStopped() && ["Take-offs are stopped", "alarms"],
    silentServices.value.length > 0 && ["A service is silent", "health"],
  ].filter(Boolean);
}

function Headline() {
  ticks.value; // read so that waiting grows old by itself
  const found = needs();
  const underWay = running().filter((each) => !each.is_waiting && each.state !== "SCHEDULED").length;
  const links = found.map(([text, ...path]) => html`<li key=${text}><a href=${pathTo(...path)}>${text}</a></li>`);
  return html`
    <header class="headline ${found.length ? "warn" : "fine"}">
      <h1>${found.length ? count(found.length, "thing needs you", "things need you") : "All is well"}</h1>
      ${found.length ? html`<ul>${links}</ul>`
        : html`<p>${count(underWay, "delivery is", "deliveries are")} under way, and none is late.</p>`}
    </header>`;
}

const sum = (states, ...names) => names.reduce((total, name) => total + (states[name] ?? 0), 0);

function DeliveriesTile({today}) {
  if (!today) return null;
  const {deliveries, by_state: states, buckets} = today;
  const parts = [
    {name: "delivered", kind: "fine", count: sum(states, "COMPLETED")},
    {name: "planned or flying", kind: "accent", count: sum(states, "PLANNED", "DISPATCHED", "LOADING", "IN_PROGRESS")},
    {name: "requested or scheduled", kind: "quiet", count: sum(states, "REQUESTED", "SCHEDULED")},
    {name: "partly delivered", kind: "warn", count: sum(states, "PARTIALLY_COMPLETED")},
    {name: "failed or rejected", kind: "danger", count: sum(states, "FAILED", "REJECTED")},
    {name: "cancelled", kind: "quiet faint", count: sum(states, "CANCELLED")},
  ];
  const bars = buckets.map(({from, deliveries: value}) =>
    ({name: clockTime(from), value, text: count(value, "delivery", "deliveries")}));
  return html`
    <${Tile} title="Deliveries today" figure=${deliveries} unit="requested" href=${pathTo("deliveries")}
      kind="large" feeds="feeds-deliveries">
      <${Bars} label="Deliveries requested in each hour" bars=${bars} slots="24" marks=${DAY_MARKS} />
      <${SplitBar} label="Deliveries of today by state" parts=${parts} />
    </${Tile}>`;
}

function WaitingTile() {
  ticks.value; // read so that ages grow
  const ages = running().filter(({is_waiting: isWaiting}) => isWaiting).map(waitingS);
  const limits = [0, ...MINUTES, Infinity];
  const parts = AGE_KINDS.map((kind, number) => ({
    kind, name: number < MINUTES.length ? `up to ${MINUTES[number]} min` : `more than ${MINUTES.at(-1)} min`,
    count: ages.filter((s) => s > limits[number] * 60 && s <= limits[number + 1] * 60).length,
  }));
  return html`
    <${Tile} title="Waiting for a drone" figure=${ages.length} unit=${ages.length === 1 ? "request" : "requests"}
      href=${pathTo("schedule")} feeds="feeds-deliveries">
      ${ages.length === 0 ? html`<p>Every request has a drone.</p>` : html`
        <${SplitBar} label="Waiting requests by age" parts=${parts} />
        <p>The oldest has waited for ${durationText(Math.max(...ages))}.</p>`}
    </${Tile}>`;
}

// Hours that are over do not change: each is read once for a session.
const pastHours = new WeakMap();

async function readPads() {
  if (!pastHours.has(session.peek())) pastHours.set(session.peek(), new Map());
  const known = pastHours.get(session.peek());
  const hours = [];
  for (const from of hoursOfToday(fleetNow())) {
    const until = Math.min(from + HOUR_MS, fleetNow());
    const total = known.get(from) ?? (await get(`/v1/stats/pads?limit=1&${spanQuery(from, until)}`)).total;
    if (fleetNow() > from + 2 * HOUR_MS) known.set(from, total);
    hours.push({from, pads: total.pads, used: (total.utilisation ?? 0) * total.pads});
  }
  return hours;
}

function PadsTile() {
  const {answer: hours} = useRead(readPads, {everyMs: PADS_AGAIN_MS});
  const taken = Object.values(picture.stations.value).reduce((all, {pads_taken: each}) => all + each, 0);
  const most = Math.max(...(hours ?? []).map(({used}) => used), 0.01);
  const cells = (hours ?? []).map(({from, used}) => ({
    name: clockTime(from), share: used / most, text: `${used.toFixed(1)} pads in use on average`,
  }));
  return html`
    <${Tile} title="Pads in use" figure=${taken} unit=${hours && `of ${hours.at(-1).pads} now`} href=${pathTo("schedule")}
      kind="large" feeds="feeds-missions">
      ${!hours && html`<p>Reading the hours of today…</p>`}
      ${hours && html`<${Heat} label="Pads in use by hour" cells=${cells} />
        <p>At most ${most.toFixed(1)} pads in use on average in an hour of today.</p>`}
    </${Tile}>`;
}

function newestReading() {
  const moments = Object.values(picture.drones.value).map(({at}) => at).filter(Boolean);
  return moments.length ? moments.reduce((one, other) => (one > other ? one : other)) : null;
}

function ServicesTile() {
  const services = Object.entries(picture.services.value);
  const newest = newestReading();
  const silent = services.filter(([, {is_answering: isAnswering}]) => !isAnswering).length;
  return html`
    <${Tile} title="Services" figure=${services.length - silent} unit=${`of ${services.length} answer`} href=${pathTo("health")}
      kind=${silent ? "danger" : ""}>
      <ul class="lines">${services.sort().map(([name, {is_answering: isAnswering, silent_since_at: since}]) => html`
        <li key=${name}><span class=${isAnswering ? "dot fine" : "dot danger"} aria-hidden="true"></span> ${name}
          ${" "}<small>${isAnswering ? "answers" : `silent${since ? `, last answer ${distanceText(since)}` : ""}`}</small></li>`)}
      </ul>
      ${newest && html`<p>The newest reading of a drone came ${distanceText(newest)}.</p>`}
    </${Tile}>`;
}

export function OperatorHome() {
  const today = useDeliveriesToday();
  return html`
    <${Headline} />
    <div class="tiles">
      <${DeliveriesTile} today=${today} />
      <${PromisesTile} today=${today} />
      <${WaitingTile} />
      <${DronesTile} kind="large" />
      <${PadsTile} />
      <${AlarmsTile} />
      <${WorkTile} />
      <${ServicesTile} />
    </div>`;
}
