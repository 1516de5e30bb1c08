// Commands to a mission. Each shows first what it would do, by a dry run, and asks for a reason.

import {signal} from "@preact/signals";
import {useEffect} from "preact/hooks";

import {part, post} from "../api.js";
import {html} from "../html.js";
import {networks, networkContent} from "../networks.js";
import {stationsOf} from "../map/features.js";
import {inWords, shortId, stationName} from "../words.js";
import {confirm} from "./confirm_dialog.js";
import {Outlook} from "./outlook.js";

const MEANINGS = {
  HOLD: "The drone lands at the next station of its plan and waits there until RESUME.",
  RESUME: "The drone goes on by a new plan, because the times of the old one have passed.",
  RETURN_HOME: "The drone brings its packages back to the pickup, and flies home.",
  CANCEL: "The mission ends. Packages on board are brought back, and all others are not picked up.",
  DIVERT: "The drone leaves its plan and lands at the chosen station.",
};
const DONE = "The command is on its way to the drone.";

const divertTo = signal("");

function ask(command, missionId) {
  const path = `/v1/missions/${part(missionId)}/commands`;
  const order = {command, ...(command === "DIVERT" ? {station_id: divertTo.value} : {})};
  confirm({
    title: `${inWords(command)}: mission ${shortId(missionId)}`,
    verb: inWords(command),
    preview: async () => {
      const {outlook} = await post(`${path}?dry_run=true`, {...order, reason: "dry run"});
      return html`<p>${MEANINGS[command]}</p><${Outlook} outlook=${outlook} />`;
    },
    action: (reason) => post(path, {...order, reason}),
    done: DONE,
  });
}

const stationIds = signal([]);

async function readStations() {
  const contents = await Promise.all((networks.value ?? []).map(({network_id}) => networkContent(network_id)));
  stationIds.value = contents.flatMap(stationsOf).map(({properties}) => properties.station_id).sort();
}

export function MissionCommands({missionId, mission}) {
  // In an effect: before networks are known, reading while drawing would draw again without end.
  useEffect(() => {
    if (stationIds.value.length === 0) readStations().catch(() => null);
  }, [networks.value]);
  const button = (command, isDisabled = false) => html`
    <button disabled=${isDisabled} onClick=${() => ask(command, missionId)}>
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
