// The steps of a mission with their times: what ended, what goes on, and what is to come. A time is the end
// of a step, and its words say so.

import {fleetNow} from "../fleet_clock.js";
import {html} from "../html.js";
import {clockTime, inWords, stationName} from "../words.js";

const NAMES = {FLY: "Fly to", RECHARGE: "Charge at", PICK_UP: "Pick up at", DELIVER: "Deliver at",
  WAIT: "Wait at", PARK: "Park at"};
const ENDS = {FLY: "lands", RECHARGE: "charged until", PICK_UP: "loaded by", DELIVER: "handed over by"};

// "Fly to Marion".
export const stepName = (kind, stationId) => `${NAMES[kind] ?? inWords(kind)} ${stationName(stationId)}`;

// "lands 17:50", "charged until 17:58".
export function endText({kind, lands}, moment) {
  const word = lands === false ? "passes" : ENDS[kind] ?? "until";
  return `${word} ${clockTime(moment)}`;
}

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
          <span>${stepName(step.kind, step.station_id)}</span>
          <time>${endText(step, step.end_at)}</time>
          ${step.package_ids?.length > 0 && html`<small>${step.package_ids.join(", ")}</small>`}
        </li>`)}
    </ol>`;
}
