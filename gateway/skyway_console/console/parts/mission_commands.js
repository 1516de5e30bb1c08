// Commands to a mission. Each shows first what it would mean, and asks for a reason.

import {signal} from "@preact/signals";

import {part, post} from "../api.js";
import {html} from "../html.js";
import {networks, networkContent} from "../networks.js";
import {stationsOf} from "../map/features.js";
import {distanceText, inWords, shortId, stationName} from "../words.js";
import {confirm} from "./confirm_dialog.js";

const MEANINGS = {
  HOLD: "The drone lands at the next station of its plan and waits there until RESUME.",
  RESUME: "The drone goes on with its plan. Times that have passed are planned again.",
  RETURN_HOME: "The drone flies home on the way that it has on board. Its packages come back with it.",
  CANCEL: "The mission ends. Packages on board are brought back, and all others are not picked up.",
  DIVERT: "The drone leaves its plan and lands at the chosen station.",
};
const DONE = "The command is on its way to the drone.";

const divertTo = signal("");

function packagesText(mission) {
  const open = Object.entries(mission.packages)
    .filter(([, eta]) => eta)
    .map(([packageId, eta]) => `${packageId} (expected ${distanceText(eta)})`);
  return open.length ? `Packages of this mission: ${open.join(", ")}.` : "It has no package left.";
}

async function consequences(command, mission) {
  return html`
    <p>${MEANINGS[command]}</p>
    <p>${mission.is_carrying ? "It carries packages now. " : ""}${packagesText(mission)}</p>
    ${command === "DIVERT" && html`<p>It lands at ${stationName(divertTo.value)}.</p>`}`;
}

function ask(command, missionId, mission) {
  const path = `/v1/missions/${part(missionId)}/commands`;
  confirm({
    title: `${inWords(command)}: mission ${shortId(missionId)}`,
    verb: inWords(command),
    preview: () => consequences(command, mission),
    action: (reason) => post(path, {
      command, reason, ...(command === "DIVERT" ? {station_id: divertTo.value} : {}),
    }),
    done: DONE,
  });
}

const stationIds = signal([]);

async function readStations() {
  const contents = await Promise.all((networks.value ?? []).map(({network_id}) => networkContent(network_id)));
  stationIds.value = contents.flatMap(stationsOf).map(({properties}) => properties.station_id).sort();
}

export function MissionCommands({missionId, mission}) {
  if (stationIds.value.length === 0) readStations().catch(() => null);
  const button = (command, isDisabled = false) => html`
    <button disabled=${isDisabled} onClick=${() => ask(command, missionId, mission)}>
      ${inWords(command)}
    </button>`;
  return html`
    <div class="commands" role="group" aria-label="Commands to the mission">
      ${mission.is_held ? button("RESUME") : button("HOLD")}
      ${button("RETURN_HOME")} ${button("CANCEL")}
      <span class="divert">
        <select aria-label="Station for a diversion" value=${divertTo.value}
          onChange=${({target}) => (divertTo.value = target.value)}>
          <option value="">Divert to…</option>
          ${stationIds.value.map((id) => html`<option value=${id}>${stationName(id)}</option>`)}
        </select>
        ${button("DIVERT", divertTo.value === "")}
      </span>
    </div>`;
}
