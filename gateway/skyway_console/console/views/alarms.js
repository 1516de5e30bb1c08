// Open alarms, the newest first, and what is closed; operators acknowledge and open again.

import {part, post} from "../api.js";
import {closureTimes, hasBegun} from "../closed.js";
import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {alarmSound, openAlarms, picture} from "../live.js";
import {pathTo} from "../routes.js";
import {isOperator} from "../session.js";
import {StateText} from "../state_words.js";
import {useReadPath} from "../use_read.js";
import {distanceText, inWords, momentText, shortId, stationName, zonedText} from "../words.js";
import {STOP_MOMENTS, askToClose, askToOpen, closureName} from "../parts/closures.js";
import {confirm} from "../parts/confirm_dialog.js";
import {Table} from "../parts/table.js";

const AGAIN_MS = 60_000;

const askToAcknowledge = (alarmId, {code}) => confirm({
  title: `Acknowledge: ${inWords(code)}`,
  verb: "Acknowledge",
  meaning: "The alarm leaves the open alarms of everybody, with your name and note. Its cause stays as it is.",
  reason: "note",
  action: (note) => post(`/v1/alarms/${part(alarmId)}/acknowledgements`, note ? {note} : {}),
  done: "The alarm is acknowledged.",
});

function about({drone_id: drone, mission_id: mission, station_id: station}) {
  return html`
    ${drone && html`<a href=${pathTo("map", "drone", drone)}>drone ${droneName(drone)}</a> `}
    ${mission && html`<span>mission ${shortId(mission)} </span>`}
    ${station && html`<a href=${pathTo("map", "station", station)}>${stationName(station)}</a>`}`;
}

const COLUMNS = [
  ["Level", ({level}) => html`<span class="tag ${level}"><${StateText} kind="alarmLevel" of=${level} /></span>`],
  ["What", ({code, detail}) => html`<strong>${inWords(code)}</strong><br />${detail}`, "title"],
  ["About", about],
  ["When", ({at}) => html`<span title=${zonedText(at)}>${distanceText(at)}</span>`],
];
const ACKNOWLEDGE = ["Acknowledge",
  (alarm) => html`<button onClick=${() => askToAcknowledge(alarm.alarm_id, alarm)}>Acknowledge</button>`, "act"];

function ClosureList({title, empty, closures}) {
  return html`
    <h2>${title}</h2>
    ${closures.length === 0 && html`<p>${empty}</p>`}
    <ul class="timeline" aria-label=${title}>
      ${closures.map(([closureId, closure]) => html`
        <li key=${closureId}>
          <strong>${closureName(closure)}</strong>${closure.reason ? `: ${closure.reason}. ` : ". "}
          Closed ${closureTimes(closure)}.${" "}
          ${isOperator() && html`
            <button class="small" onClick=${() => askToOpen(closureId, closure)}>Open again</button>`}
        </li>`)}
    </ul>`;
}

const stopAll = () => askToClose("Stop all take-offs", "/v1/ground-stops", {}, STOP_MOMENTS);

function Closures() {
  const closures = Object.entries(picture.closures.value);
  const [begun, later] = [true, false].map(
    (isBegun) => closures.filter(([, closure]) => hasBegun(closure) === isBegun));
  return html`
    <${ClosureList} title="Closed now" empty="Nothing is closed." closures=${begun} />
    ${later.length > 0 && html`<${ClosureList} title="Closed later" closures=${later} />`}
    ${isOperator() && html`
      <button class="danger" onClick=${stopAll}>
        Stop all take-offs…
      </button>`}`;
}

function Acknowledged() {
  // Read again when an alarm comes or goes.
  const {answer} = useReadPath("/v1/alarms?state=ACKNOWLEDGED&limit=20",
    {changed: openAlarms.value.length, everyMs: AGAIN_MS});
  const items = answer?.items ?? [];
  return html`
    <h2>Acknowledged</h2>
    <ul class="timeline">
      ${answer?.items.length === 0 && html`<li>None yet. Alarms that an operator has seen stand here.</li>`}
      ${items.map(({alarm_id, code, detail, acknowledged_by, acknowledged_at, note}) => html`
        <li key=${alarm_id}>
          <time>${momentText(acknowledged_at)}</time><strong>${inWords(code)}</strong> ${detail}
          <br /><small>by ${acknowledged_by}${note ? `: ${note}` : ""}</small>
        </li>`)}
    </ul>`;
}

export function AlarmsView() {
  return html`
    <div class="page">
      <h1>Alarms</h1>
      <label class="check"><input type="checkbox" checked=${alarmSound.value}
        onChange=${({target}) => (alarmSound.value = target.checked)} /> Sound at new alarms, also when this tab is hidden</label>
      <${Table} label="Open alarms" feeds="feeds-missions" items=${openAlarms.value}
        columns=${isOperator() ? [...COLUMNS, ACKNOWLEDGE] : COLUMNS}
        row=${({alarm_id: id}) => ({key: id, "data-alarm": id})}
        empty="No open alarm. An alarm comes here as soon as a drone or a delivery needs somebody." />
      <div class="columns">
        <section><${Closures} /></section>
        <section><${Acknowledged} /></section>
      </div>
    </div>`;
}
