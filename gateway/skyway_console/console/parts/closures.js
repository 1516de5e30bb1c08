// Closures: what one would change, shown before it is made; and opening again.

import {call, part, post} from "../api.js";
import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {previewClosure} from "../preview.js";
import {distanceText, shortId, stationName} from "../words.js";
import {confirm} from "./confirm_dialog.js";
import {delayText} from "./outlook.js";

// So many missions are planned by a dry run, and shown.
const SHOWN = 20;

const delayed = ({delay}) => (delay ? `: ${delayText(delay)}` : "");

const flownBy = ({mission_id: id, drone_id: drone}) => (drone ? droneName(drone) : `mission ${shortId(id)}`);

function affectedText({affected_missions: missions}) {
  if (missions.length === 0) return html`<p>No mission needs another plan.</p>`;
  return html`
    <p>${missions.length === 1 ? "1 mission needs" : `${missions.length} missions need`} another plan:</p>
    <ul>
      ${missions.slice(0, SHOWN).map((mission) => html`
        <li>${flownBy(mission)}, ${distanceText(mission.at)}${delayed(mission)}</li>`)}
      ${missions.length > SHOWN && html`<li>and ${missions.length - SHOWN} more</li>`}
    </ul>`;
}

// A ground stop needs a reason in its dry run too.
const DRY_RUN = {reason: "dry run"};

const CLOSURE_MOMENTS = ["from_at", "until"];
// A ground stop begins immediately.
export const STOP_MOMENTS = ["until"];

// What a closure does, by the end of the path that makes it.
const CLOSINGS = {
  closures: "New plans do not use it. Missions that planned to use it get another plan.",
  outages: "Nobody gets this pad. Missions that have booked it get another pad or another plan.",
  zones: "Drones may not fly through the area. Missions that planned to do so get another plan.",
  "ground-stops": "Drones do not take off. Drones in the air fly on to their next landing.",
};

// A closure of the API, with its stations as the live picture names them.
const asShown = ({from_id: from, to_id: to, ...closure}) => ({
  ...closure, station_id: from ?? closure.station_id, to_station_id: to});

const lift = async (closure) => call("DELETE", closurePath(closure.closure_id, asShown(closure)));

// Asks before something is closed: `path` makes the closure, `order` is what is sent.
export function askToClose(title, path, order = {}, moments = CLOSURE_MOMENTS) {
  const kind = path.split("/").at(-1);
  const isStop = kind === "ground-stops";
  confirm({
    title,
    verb: isStop ? "Stop take-offs" : "Close it",
    meaning: CLOSINGS[kind],
    moments,
    preview: async (chosen) => {
      const outlook = await post(`${path}?dry_run=true`, {...order, ...chosen, ...DRY_RUN});
      previewClosure(outlook);
      return affectedText(outlook);
    },
    action: (reason, chosen) => post(path, {...order, ...chosen, reason}),
    done: isStop ? "Take-offs are stopped." : "The closure is made. Missions that need it get another plan.",
    undo: {action: lift, done: isStop ? "The ground stop has ended." : "It is open again."},
  });
}

// By the kind of a closure: its name and its path.
const KINDS = {
  STATION: ({station_id: station}, id) =>
    [`Station ${stationName(station)}`, `/v1/stations/${part(station)}/closures/${id}`],
  PAD: ({station_id: station, pad}, id) =>
    [`Pad ${pad} of ${stationName(station)}`, `/v1/stations/${part(station)}/pads/${pad}/outages/${id}`],
  SEGMENT: ({station_id: station, to_station_id: to}, id) =>
    [`Segment ${stationName(station)} – ${stationName(to)}`, `/v1/segments/${part(station)}/${part(to)}/closures/${id}`],
  ZONE: (_, id) => ["Area", `/v1/zones/${id}`],
  GROUND_STOP: (_, id) => ["Ground stop", `/v1/ground-stops/${id}`],
};

const closurePath = (closureId, closure) => KINDS[closure.kind](closure, part(closureId))[1];

export const closureName = (closure) => KINDS[closure.kind](closure)[0];

const OPENED = "New plans may use it again, and what waits for it is planned again. Missions that have "
  + "a plan keep it.";
const STARTED = "Drones may take off again, and what waits for that is planned again.";

export function askToOpen(closureId, closure) {
  const name = closureName(closure);
  const isStop = closure.kind === "GROUND_STOP";
  confirm({
    title: isStop ? "End the ground stop" : `Open again: ${name}`,
    verb: isStop ? "End it" : "Open it",
    reason: "none",
    meaning: isStop ? STARTED : OPENED,
    action: () => call("DELETE", closurePath(closureId, closure)),
    done: isStop ? "The ground stop has ended." : `${name} is open again.`,
  });
}
