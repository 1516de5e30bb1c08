// The schedule: drones or pads against time, what is booked on them, where the gaps are, and which plans have
// changed. On a phone it is a list of the next trips of each drone.

import {useState} from "preact/hooks";

import {fleetNow} from "../fleet_clock.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {isNarrow} from "../narrow.js";
import {isOperator} from "../session.js";
import {useRead} from "../use_read.js";
import {zoneName} from "../words.js";
import {Calendar, moved, zoomed} from "../parts/calendar.js";
import {PlanChanges} from "../parts/plan_changes.js";
import {readDrones, readPads} from "../parts/schedule_rows.js";
import {TripCards} from "../parts/trip_cards.js";
import {WaitingRequests} from "../parts/waiting_requests.js";

const AGAIN_MS = 5_000;
const HOUR_MS = 3_600_000;

const READERS = {drones: readDrones, pads: readPads};

function useRows(of, {from, to}) {
  // The live picture names the packages, so the rows are made again when it has come.
  const hasPicture = Object.keys(picture.missions.value).length > 0;
  const {answer, problem} = useRead(() => READERS[of]({from, to}),
    {changed: `${of} ${from} ${to} ${hasPicture}`, everyMs: AGAIN_MS});
  return {rows: answer, problem};
}

const firstSpan = () => ({from: fleetNow() - HOUR_MS, to: fleetNow() + 3 * HOUR_MS});

// The states of missions, as the API names them, and what else is drawn.
const LEGEND = [["ACTIVE", "Active"], ["ACCEPTED", "Accepted"], ["BOOKED", "Booked"], ["QUEUED", "Queued"],
  ["COMPLETED", "Completed"], ["standby", "Way home or standby"]];

const Legend = () => html`
  <ul class="schedule-key" aria-label="Legend">
    ${LEGEND.map(([kind, text]) => html`<li><span class="swatch ${kind}"></span>${text}</li>`)}
    <li><span class="diamond"></span>Promised</li>
    <li><span class="diamond missed"></span>Promised, comes too late</li>
    <li><span class="swatch charge"></span>Charge</li>
  </ul>`;

function SpanButtons({span, onSpan}) {
  const button = (name, text, next) => html`
    <button aria-label=${name} title=${name} onClick=${() => onSpan(next())}>${text}</button>`;
  return html`
    <div class="commands" role="group" aria-label="Span">
      ${button("Earlier", "←", () => moved(span, -0.25))} ${button("Now", "Now", firstSpan)}
      ${button("Later", "→", () => moved(span, 0.25))}
      ${button("See less", "+", () => zoomed(span, 0.5))} ${button("See more", "−", () => zoomed(span, 2))}
    </div>`;
}

function Rows({rows, of, span, onSpan}) {
  if (rows === null) return html`<p>Reading…</p>`;
  if (rows.length === 0) {
    return html`<p class="empty-schedule">${of === "drones"
      ? "No drone has connected yet. Register drones in Fleet, and start their agents."
      : "No pad is booked in this span. Pads are booked when deliveries are planned."}</p>`;
  }
  if (isNarrow.value) return html`<${TripCards} rows=${rows} />`;
  return html`
    <${Calendar} rows=${rows} span=${span} onSpan=${onSpan} />
    <p class="hint">Times are ${zoneName()}. Drag, or press ← and → to look back or ahead; press + and − to see less or more.</p>`;
}

export function ScheduleView() {
  const [of, setOf] = useState("drones");
  const [span, setSpan] = useState(firstSpan);
  const {rows, problem} = useRows(of, span);
  const choice = (each, text) => html`
    <button aria-pressed=${of === each} onClick=${() => setOf(each)}>${text}</button>`;
  return html`
    <div class="page">
      <h1>Schedule</h1>
      <div class="filters">
        <div class="commands" role="group" aria-label="Rows">${choice("drones", "Drones")} ${choice("pads", "Pads")}</div>
        ${!isNarrow.value && html`<${SpanButtons} span=${span} onSpan=${setSpan} /><${Legend} />`}
      </div>
      ${problem && html`<p class="refused">${problem}</p>`}
      <${Rows} rows=${rows} of=${of} span=${span} onSpan=${setSpan} />
      <div class="columns">
        <section><${PlanChanges} /></section>
        ${isOperator() && html`<section><${WaitingRequests} /></section>`}
      </div>
    </div>`;
}
