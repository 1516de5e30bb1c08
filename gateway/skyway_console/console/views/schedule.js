// The calendar: drones or pads against time, what is booked on them, and where the gaps are.

import {useEffect, useState} from "preact/hooks";

import {all, get, part} from "../api.js";
import {fleetNow} from "../fleet_clock.js";
import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {stationsOf} from "../map/features.js";
import {listNetworks, networkContent} from "../networks.js";
import {isOperator, session} from "../session.js";
import {shortId, stationName} from "../words.js";
import {Calendar} from "../parts/calendar.js";
import {WaitingRequests} from "../parts/waiting_requests.js";

const AGAIN_MS = 5_000;
const MOST_ROWS = 200;
const HOUR_MS = 3_600_000;

const spanText = ({from, to}) =>
  `from=${new Date(from).toISOString()}&to=${new Date(to).toISOString()}`;

async function readProviders() {
  if (!isOperator()) return [session.value.subject_id];
  return (await all("/v1/providers")).map(({provider_id}) => provider_id);
}

// Rows of the calendar: a name, and bars with times in milliseconds.
async function readDrones(span) {
  const rows = [];
  for (const provider of await readProviders()) {
    if (rows.length >= MOST_ROWS) break;
    const items = await all(`/v1/providers/${part(provider)}/schedule?${spanText(span)}`, MOST_ROWS);
    rows.push(...items.map(droneRow));
  }
  return rows.slice(0, MOST_ROWS);
}

function droneRow({drone_id, entries}) {
  const name = droneName(drone_id);
  const bars = entries.flatMap(({mission_id, delivery_id, state, service, standby}) => {
    const [start, served] = [Date.parse(service.start_at), Date.parse(service.served_at)];
    const way = `${stationName(service.from_station_id)} to ${stationName(service.to_station_id)}`;
    const bar = {start, end: served, kind: state, href: ["deliveries", delivery_id],
      text: `mission ${shortId(mission_id)}, ${way}`};
    const until = standby && Date.parse(standby.until_at);
    if (!(until > served)) return [bar];
    return [bar, {start: served, end: until, kind: "standby", text: "way home or standby, gives way"}];
  });
  return {id: drone_id, name, bars, href: ["map", "drone", drone_id]};
}

async function readPads(span) {
  const contents = await Promise.all(
    (await listNetworks()).map(({network_id}) => networkContent(network_id)));
  const busy = contents.flatMap(stationsOf)
    .map(({properties}) => properties.station_id)
    .filter((id) => picture.stations.value[id])
    .sort().slice(0, 40);
  const schedules = await Promise.all(
    busy.map((id) => get(`/v1/stations/${part(id)}/schedule?${spanText(span)}`)));
  return schedules.flatMap(({station_id, pads}) => pads
    .filter(({entries}) => entries.length > 0)
    .map(({pad, entries}) => ({
      id: `${station_id} ${pad}`,
      name: `${stationName(station_id)}, pad ${pad}`,
      href: ["map", "station", station_id],
      bars: entries.map(({start_at, end_at, mission_id}) => ({
        start: Date.parse(start_at), end: Date.parse(end_at), kind: "taken",
        text: mission_id ? `mission ${shortId(mission_id)}` : "taken",
      })),
    })));
}

const READERS = {drones: readDrones, pads: readPads};

function useRows(of, span) {
  const [rows, setRows] = useState(null);
  const [problem, setProblem] = useState("");
  useEffect(() => {
    let isGone = false;
    const look = () => READERS[of](span).then(
      (read) => isGone || (setRows(read), setProblem("")),
      (refusal) => isGone || setProblem(refusal.message));
    look();
    const timer = setInterval(look, AGAIN_MS);
    return () => {
      isGone = true;
      clearInterval(timer);
    };
  }, [of, span.from, span.to]);
  return {rows, problem};
}

const firstSpan = () => ({from: fleetNow() - HOUR_MS, to: fleetNow() + 11 * HOUR_MS});

export function ScheduleView() {
  const [of, setOf] = useState("drones");
  const [span, setSpan] = useState(firstSpan);
  const {rows, problem} = useRows(of, span);
  const choice = (each, text) => html`
    <button aria-pressed=${of === each} onClick=${() => setOf(each)}>${text}</button>`;
  return html`
    <div class="page">
      <h1>Schedule</h1>
      <div class="filters" role="group" aria-label="Rows">
        ${choice("drones", "Drones")} ${choice("pads", "Pads")}
        <button class="quiet" onClick=${() => setSpan(firstSpan())}>Now</button>
        <span class="hint">Drag or press ← and → to look back or ahead; press + and − to see less or more.</span>
      </div>
      ${problem && html`<p class="refused">${problem}</p>`}
      ${rows === null ? html`<p>Reading…</p>` : html`<${Calendar} rows=${rows} span=${span} onSpan=${setSpan} />`}
      ${rows?.length === 0 && html`<p>Nothing is booked in this span.</p>`}
      <p class="gantt key" aria-label="Legend">
        <span class="swatch ACTIVE"></span> flies <span class="swatch ACCEPTED"></span> accepted
        <span class="swatch QUEUED"></span> waits <span class="swatch COMPLETED"></span> done
      </p>
      ${isOperator() && html`<${WaitingRequests} />`}
    </div>`;
}
