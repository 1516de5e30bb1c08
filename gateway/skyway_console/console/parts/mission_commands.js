// Commands to a mission. Each shows first what it would do, by a dry run in words and on the map, and
// asks for a reason.

import {signal} from "@preact/signals";

import {part, post} from "../api.js";
import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {allStationIds} from "../networks.js";
import {previewLanding} from "../preview.js";
import {useRead} from "../use_read.js";
import {stationName} from "../words.js";
import {confirm} from "./confirm_dialog.js";
import {Outlook} from "./outlook.js";

// What a command is called, and what it does.
const COMMANDS = {
  HOLD: ["Hold", "The drone lands at the next station of its plan and waits there until somebody resumes it."],
  RESUME: ["Resume", "The drone goes on by a new plan, because the times of the old one have passed."],
  RETURN_HOME: ["Call home", "The drone brings its packages back to the pickup, and flies home."],
  CANCEL: ["Cancel", "The mission ends. Packages on board are brought back, and all others are not picked up."],
  DIVERT: ["Divert", "The drone leaves its plan, lands at the chosen station and waits there."],
};
const DONE = "The command is on its way to the drone.";

const divertTo = signal("");

// A drone that was held or diverted goes on when it is resumed; what else was ordered has no way back.
const undoBy = (path) => ({
  action: () => post(path, {command: "RESUME", reason: "undone by the operator"}),
  done: "The drone goes on by a new plan.",
});

function ask(command, missionId, droneId) {
  const path = `/v1/missions/${part(missionId)}/commands`;
  const order = {command, ...(command === "DIVERT" ? {station_id: divertTo.value} : {})};
  const [name, meaning] = COMMANDS[command];
  confirm({
    title: `${name}: drone ${droneName(droneId)}`,
    verb: name,
    meaning,
    preview: async () => {
      const {outlook} = await post(`${path}?dry_run=true`, {...order, reason: "dry run"});
      previewLanding(droneId, outlook.next_landing?.station_id);
      return html`<${Outlook} outlook=${outlook} />`;
    },
    action: (reason) => post(path, {...order, reason}),
    done: DONE,
    undo: ["HOLD", "DIVERT"].includes(command) ? undoBy(path) : null,
  });
}

export function MissionCommands({missionId, mission}) {
  const stationIds = useRead(allStationIds).answer ?? [];
  const button = (command, isDisabled = false) => html`
    <button disabled=${isDisabled} title=${COMMANDS[command][1]}
      onClick=${() => ask(command, missionId, mission.drone_id)}>${COMMANDS[command][0]}</button>`;
  return html`
    <div class="commands" role="group" aria-label="Commands to the mission">
      ${mission.is_held ? button("RESUME") : button("HOLD")}
      ${button("RETURN_HOME")} ${button("CANCEL")}
      <span class="divert">
        <select aria-label="Station for a diversion" value=${divertTo.value}
          onChange=${({target}) => (divertTo.value = target.value)}>
          <option value="">Divert to…</option>
          ${stationIds.map((id) => html`<option value=${id}>${stationName(id)}</option>`)}
        </select>
        ${button("DIVERT", divertTo.value === "")}
      </span>
    </div>`;
}
