// The steps of a mission with their times: what ended, what goes on, and what is to come.

import {fleetNow} from "../fleet_clock.js";
import {html} from "../html.js";
import {inWords, clockTime, stationName} from "../words.js";

const NAMES = {FLY: "Fly to", RECHARGE: "Charge at", PICK_UP: "Pick up at", DELIVER: "Deliver at",
  WAIT: "Wait at", PARK: "Park at"};

function placeOf(step, now) {
  if (step.status === "ENDED") return "past";
  return Date.parse(step.start_at) <= now ? "now" : "";
}

export function StepList({mission}) {
  const now = fleetNow();
  return html`
    <ol class="steps">
      ${Object.entries(mission.steps).map(([number, step]) => html`
        <li key=${number} class=${placeOf(step, now)}>
          <time>${clockTime(step.end_at)}</time>
          <span>${NAMES[step.kind] ?? inWords(step.kind)} ${stationName(step.station_id)}</span>
          ${step.package_ids?.length > 0 && html`<small>${step.package_ids.join(", ")}</small>`}
        </li>`)}
    </ol>`;
}
