// A past hour again, at 1 to 300 times its speed: where the drones were, what was closed, the alarms
// of that time, and the plan of the drone that is chosen. An address may name the beginning and the drone.

import {useEffect, useRef, useState} from "preact/hooks";

import {all, spanQuery} from "../api.js";
import {droneName} from "../drone_names.js";
import {fleetNow} from "../fleet_clock.js";
import {html} from "../html.js";
import {useFleetMap} from "../map/use_fleet_map.js";
import {isNarrow} from "../narrow.js";
import {useNetwork} from "../use_network.js";
import {useRead} from "../use_read.js";
import {dronesAt, readRecord} from "../parts/flight_record.js";
import {attempt} from "../parts/messages.js";
import {closuresAt, missionAt, readClosures, readPlans} from "../parts/past_plans.js";
import {eventsOf} from "../parts/replay_events.js";
import {ReplayPlayer, exactTime, keysOf} from "../parts/replay_player.js";

const HOUR_MS = 3_600_000;
const STEP_MS = 100;
const MOST_ALARMS = 500;

// The moment that is shown; it runs while `isPlaying`.
function usePlayer(span, isPlaying, speed) {
  const [atMs, setAt] = useState(span.from);
  useEffect(() => setAt(span.from), [span.from]);
  useEffect(() => {
    if (!isPlaying) return undefined;
    const timer = setInterval(
      () => setAt((before) => Math.min(span.until, before + STEP_MS * speed)), STEP_MS);
    return () => clearInterval(timer);
  }, [isPlaying, speed, span.until]);
  const moveTo = (ms) => setAt(Math.max(span.from, Math.min(span.until, ms)));
  return [atMs, moveTo];
}

// The alarms of the span, the oldest first.
const alarmsOf = async (span) => (await all(`/v1/alarms?${spanQuery(span.from, span.until)}`, MOST_ALARMS)).reverse();

const NOTHING = {record: new Map(), alarms: [], closures: []};

function useRecord(span) {
  const [read, setRead] = useState({...NOTHING, text: "Reading…"});
  useEffect(() => {
    let isGone = false;
    const show = (next) => isGone || setRead(next);
    attempt(async () => {
      const [alarms, closures] = await Promise.all([alarmsOf(span), readClosures(span)]);
      const {record, isCut} = await readRecord(span, (done, of) => show(
        {...NOTHING, alarms, closures, text: `Reading ${done} of ${of} drones…`}));
      const kept = record.size === 1 ? "1 drone" : `${record.size} drones`;
      const cut = isCut ? ", of the first 300" : "";
      show({record, alarms, closures, text: record.size ? `${kept} measured something${cut}.`
        : "Nothing is kept of this hour."});
    });
    return () => (isGone = true);
  }, [span.from, span.until]);
  return read;
}

const NO_PLANS = [];

// The plans of the chosen drone in the span.
const usePlans = (droneId, span) => useRead(
  async () => (droneId === null ? [] : readPlans(droneId, span)), {key: `${droneId} ${span.from}`});

const Chosen = ({droneId, onAll}) => html`
  <p class="chosen">${droneId
    ? html`<strong>Drone ${droneName(droneId)}</strong>, with its plan of that time.${" "}
      <button class="small" onClick=${onAll}>All drones</button>`
    : "Click a drone to see its plan and landings. Space plays, ← and → step, P and N jump to events."}</p>`;

// What happened, each with a jump to it. `atMs` marks what has happened already.
function Happenings({events, atMs, onAt}) {
  if (events.length === 0) return null;
  return html`
    <details class="happenings" open=${!isNarrow.peek()}>
      <summary>${events.length === 1 ? "1 event" : `${events.length} events`} of this hour</summary>
      <ul aria-label="What happened in this hour">
        ${events.map(({id, kind, atMs: at, text}) => html`
          <li key=${id} class=${at <= atMs ? "past" : ""}>
            <button class="small" onClick=${() => onAt(at)}>${exactTime(at)}</button>
            <span class="event-kind ${kind}"></span>${text}</li>`)}
      </ul>
    </details>`;
}

// The hour that an address names, or the one that has just passed.
function spanFrom(from) {
  const begin = Number.isNaN(from) ? fleetNow() - HOUR_MS : from;
  return {from: begin, until: begin + HOUR_MS};
}

export function ReplayView({parts: [fromText, chosen]}) {
  const view = useRef(null);
  const [droneId, setDrone] = useState(chosen ?? null);
  const {network, problem: noNetwork} = useNetwork();
  const {map, element, shown} = useFleetMap({onClick: ({droneId: clicked}) => setDrone(clicked ?? null), network});
  const [span, setSpan] = useState(() => spanFrom(Date.parse(fromText)));
  const [isPlaying, setPlaying] = useState(false);
  const [speed, setSpeed] = useState(60);
  const {text, ...past} = useRecord(span);
  const {record, closures} = past;
  const [atMs, setAt] = usePlayer(span, isPlaying, speed);
  const {answer, problem} = usePlans(droneId, span);
  const plans = answer ?? NO_PLANS;
  const drones = dronesAt(record, atMs);
  const closed = closuresAt(closures, atMs);
  const events = eventsOf(past, plans, droneId, span);
  const player = {span, atMs, onAt: setAt, isPlaying, onPlay: setPlaying, events};
  useEffect(() => map.current.drones.show(drones), [record, atMs]);
  useEffect(() => map.current.drones.select(droneId), [droneId]);
  useEffect(() => map.current.showPlan(missionAt(plans, atMs), drones[droneId]), [plans, record, atMs]);
  useEffect(() => map.current.showStations({}, closed), [shown, Object.keys(closed).join()]);
  // Keys work as soon as the view is open.
  useEffect(() => view.current.focus(), []);
  return html`
    <div class="replay-view" ref=${view} tabindex="-1" onKeyDown=${keysOf(player)}>
      <h1 class="unseen">Replay</h1>
      <${ReplayPlayer} ...${player} text=${noNetwork || problem || text} onSpan=${(from) => setSpan(spanFrom(from))} speed=${speed}
        onSpeed=${setSpeed}><${Chosen} droneId=${droneId} onAll=${() => setDrone(null)} /></${ReplayPlayer}>
      <div class="replay-body">
        <div class="map-view">
          ${element("Map of a past hour")}
        </div>
        <${Happenings} events=${events} atMs=${atMs} onAt=${setAt} />
      </div>
    </div>`;
}
