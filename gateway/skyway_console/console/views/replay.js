// A past hour again, at 1 to 600 times its speed: where the drones were, what was closed, the alarms
// of that time, and the plan of the drone that is clicked.

import {useEffect, useRef, useState} from "preact/hooks";

import {all} from "../api.js";
import {fleetNow} from "../fleet_clock.js";
import {html} from "../html.js";
import {FleetMap} from "../map/fleet_map.js";
import {listNetworks, networkContent, shownNetwork} from "../networks.js";
import {inWords, momentText} from "../words.js";
import {closureName} from "../parts/closures.js";
import {dronesAt, readRecord} from "../parts/flight_record.js";
import {attempt} from "../parts/messages.js";
import {closuresAt, missionAt, readClosures, readPlans, spanOf} from "../parts/past_plans.js";

const HOUR_MS = 3_600_000;
const SPEEDS = [1, 10, 60, 120, 300, 600];
const STEP_MS = 100;
const MOST_ALARMS = 500;

// A moment as an input of the type "datetime-local" writes it, in the browser's own zone.
function localText(ms) {
  const date = new Date(ms);
  return new Date(ms - date.getTimezoneOffset() * 60_000).toISOString().slice(0, 16);
}

// The map, and whether the network is on it.
function useMap(container, onDrone) {
  const map = useRef(null);
  const [isShown, setShown] = useState(false);
  useEffect(() => {
    const made = new FleetMap(container.current, ({droneId}) => onDrone(droneId ?? null));
    map.current = made;
    container.current.fleetMap = made;
    attempt(async () => {
      await listNetworks();
      if (shownNetwork.value === null) return;
      const content = await networkContent(shownNetwork.value);
      await made.isReady;
      made.showNetwork(content);
      setShown(true);
    });
    return () => made.remove();
  }, []);
  return [map, isShown];
}

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
  return [atMs, setAt];
}

// The alarms of the span, the oldest first.
const alarmsOf = async (span) => (await all(`/v1/alarms?${spanOf(span)}`, MOST_ALARMS)).reverse();

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

// The plans of the chosen drone in the span.
function usePlans(droneId, span) {
  const [plans, setPlans] = useState([]);
  useEffect(() => {
    let isGone = false;
    setPlans([]);
    if (droneId !== null) {
      attempt(async () => {
        const found = await readPlans(droneId, span);
        if (!isGone) setPlans(found);
      });
    }
    return () => (isGone = true);
  }, [droneId, span.from, span.until]);
  return plans;
}

function Controls({span, onSpan, atMs, onAt, speed, onSpeed, isPlaying, onPlay, text}) {
  const choose = ({target}) => {
    const from = new Date(target.value).getTime();
    if (!Number.isNaN(from)) onSpan({from, until: from + HOUR_MS});
  };
  return html`
    <div class="player">
      <label>From <input type="datetime-local" value=${localText(span.from)} onChange=${choose} /></label>
      <button onClick=${() => onPlay(!isPlaying)}>${isPlaying ? "Pause" : "Play"}</button>
      <label>Speed <select value=${speed} onChange=${({target}) => onSpeed(Number(target.value))}>
        ${SPEEDS.map((each) => html`<option value=${each}>×${each}</option>`)}
      </select></label>
      <input type="range" aria-label="Moment" min=${span.from} max=${span.until} step="1000"
        value=${atMs} onInput=${({target}) => onAt(Number(target.value))} />
      <output>${new Date(atMs).toLocaleTimeString([], {hourCycle: "h23"})}</output>
      <span class="hint" role="status">${text}</span>
    </div>`;
}

const jump = (moment, onAt) => html`
  <button class="small" onClick=${() => onAt(Date.parse(moment))}>${momentText(moment)}</button>`;

function Happenings({alarms, closures, onAt}) {
  if (alarms.length + closures.length === 0) return null;
  return html`
    <aside class="legend" aria-label="What happened in this hour">
      <ul>
        ${alarms.map(({alarm_id, at, code}) => html`
          <li key=${alarm_id}>${jump(at, onAt)} ${inWords(code)}</li>`)}
        ${closures.map((each) => html`
          <li key=${each.closure_id}>${jump(each.from_at, onAt)} ${closureName(each)}${each.kind === "GROUND_STOP" ? "" : " closed"}</li>`)}
      </ul>
    </aside>`;
}

export function ReplayView() {
  const container = useRef(null);
  const [droneId, setDrone] = useState(null);
  const [map, isShown] = useMap(container, setDrone);
  const [span, setSpan] = useState(() => ({from: fleetNow() - HOUR_MS, until: fleetNow()}));
  const [isPlaying, setPlaying] = useState(false);
  const [speed, setSpeed] = useState(60);
  const {record, alarms, closures, text} = useRecord(span);
  const [atMs, setAt] = usePlayer(span, isPlaying, speed);
  const plans = usePlans(droneId, span);
  const drones = dronesAt(record, atMs);
  const closed = closuresAt(closures, atMs);
  useEffect(() => map.current.drones.show(drones), [record, atMs]);
  useEffect(() => map.current.showPlan(missionAt(plans, atMs), drones[droneId]), [plans, record, atMs]);
  useEffect(() => map.current.showStations({}, closed), [isShown, Object.keys(closed).join()]);
  return html`
    <div class="replay-view">
      <h1 class="hidden">Replay</h1>
      <${Controls} span=${span} onSpan=${setSpan} atMs=${atMs} onAt=${setAt} speed=${speed}
        onSpeed=${setSpeed} isPlaying=${isPlaying} onPlay=${setPlaying} text=${text} />
      <div class="map-view">
        <div class="map" ref=${container} role="application" aria-label="Map of a past hour"></div>
        <${Happenings} alarms=${alarms} closures=${closures} onAt=${setAt} />
      </div>
    </div>`;
}
