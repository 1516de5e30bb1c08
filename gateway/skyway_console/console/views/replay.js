// A past hour again, at 1 to 600 times its speed: where the drones were, and the alarms of that time.

import {useEffect, useRef, useState} from "preact/hooks";

import {get} from "../api.js";
import {fleetNow} from "../fleet_clock.js";
import {html} from "../html.js";
import {FleetMap} from "../map/fleet_map.js";
import {listNetworks, networkContent, shownNetwork} from "../networks.js";
import {inWords, momentText} from "../words.js";
import {dronesAt, readRecord} from "../parts/flight_record.js";
import {attempt} from "../parts/messages.js";

const HOUR_MS = 3_600_000;
const SPEEDS = [1, 10, 60, 120, 300, 600];
const STEP_MS = 100;

// A moment as an input of the type "datetime-local" writes it, in the browser's own zone.
function localText(ms) {
  const date = new Date(ms);
  return new Date(ms - date.getTimezoneOffset() * 60_000).toISOString().slice(0, 16);
}

function useMap(container) {
  const map = useRef(null);
  useEffect(() => {
    const made = new FleetMap(container.current, () => null);
    map.current = made;
    container.current.fleetMap = made;
    attempt(async () => {
      await listNetworks();
      if (shownNetwork.value === null) return;
      const content = await networkContent(shownNetwork.value);
      await made.isReady;
      made.showNetwork(content);
      made.showStations({}, {});
    });
    return () => made.remove();
  }, []);
  return map;
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

async function alarmsOf({from, until}) {
  const {items} = await get("/v1/alarms?limit=200");
  return items.filter(({at}) => Date.parse(at) >= from && Date.parse(at) <= until).reverse();
}

function useRecord(span) {
  const [read, setRead] = useState({record: new Map(), alarms: [], text: "Reading…"});
  useEffect(() => {
    let isGone = false;
    const show = (next) => isGone || setRead(next);
    attempt(async () => {
      const alarms = await alarmsOf(span);
      const {record, isCut} = await readRecord(span, (done, of) => show(
        {record: new Map(), alarms, text: `Reading ${done} of ${of} drones…`}));
      const kept = record.size === 1 ? "1 drone" : `${record.size} drones`;
      const cut = isCut ? ", of the first 300" : "";
      show({record, alarms, text: record.size ? `${kept} measured something${cut}.`
        : "Nothing is kept of this hour."});
    });
    return () => (isGone = true);
  }, [span.from, span.until]);
  return read;
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

export function ReplayView() {
  const container = useRef(null);
  const map = useMap(container);
  const [span, setSpan] = useState(() => ({from: fleetNow() - HOUR_MS, until: fleetNow()}));
  const [isPlaying, setPlaying] = useState(false);
  const [speed, setSpeed] = useState(60);
  const {record, alarms, text} = useRecord(span);
  const [atMs, setAt] = usePlayer(span, isPlaying, speed);
  useEffect(() => map.current.drones.show(dronesAt(record, atMs)), [record, atMs]);
  return html`
    <div class="replay-view">
      <h1 class="hidden">Replay</h1>
      <${Controls} span=${span} onSpan=${setSpan} atMs=${atMs} onAt=${setAt} speed=${speed}
        onSpeed=${setSpeed} isPlaying=${isPlaying} onPlay=${setPlaying} text=${text} />
      <div class="map-view">
        <div class="map" ref=${container} role="application" aria-label="Map of a past hour"></div>
        ${alarms.length > 0 && html`
          <aside class="legend" aria-label="Alarms of this hour">
            <ul>${alarms.map(({alarm_id, at, code}) => html`
              <li key=${alarm_id}><button class="small" onClick=${() => setAt(Date.parse(at))}>
                ${momentText(at)}</button> ${inWords(code)}</li>`)}</ul>
          </aside>`}
      </div>
    </div>`;
}
