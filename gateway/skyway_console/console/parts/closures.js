// Closures: what one would change, shown before it is made; and opening again.

import {call, part, post} from "../api.js";
import {html} from "../html.js";
import {distanceText, shortId, stationName} from "../words.js";
import {confirm} from "./confirm_dialog.js";
import {delayText} from "./outlook.js";

// So many missions are planned by a dry run, and shown.
const SHOWN = 20;

const delayed = ({delay}) => (delay ? `: ${delayText(delay)}` : "");

export function affectedText({affected_missions: missions}) {
  if (missions.length === 0) return html`<p>No mission needs another plan.</p>`;
  return html`
    <p>${missions.length === 1 ? "1 mission needs" : `${missions.length} missions need`} another plan:</p>
    <ul>
      ${missions.slice(0, SHOWN).map((mission) => html`
        <li>mission ${shortId(mission.mission_id)}, ${distanceText(mission.at)}${delayed(mission)}</li>`)}
      ${missions.length > SHOWN && html`<li>and ${missions.length - SHOWN} more</li>`}
    </ul>`;
}

// A ground stop needs a reason in its dry run too.
const DRY_RUN = {reason: "dry run"};

const CLOSURE_MOMENTS = ["from_at", "until"];
// A ground stop begins immediately.
export const STOP_MOMENTS = ["until"];

// Asks before something is closed: `path` makes the closure, `order` is what is sent.
export function askToClose(title, path, order = {}, moments = CLOSURE_MOMENTS) {
  confirm({
    title,
    verb: "Close it",
    moments,
    preview: async (chosen) =>
      affectedText(await post(`${path}?dry_run=true`, {...order, ...chosen, ...DRY_RUN})),
    action: (reason, chosen) => post(path, {...order, ...chosen, reason}),
    done: "The closure is made. Missions that need it get another plan.",
  });
}

export function closurePath(closureId, closure) {
  const id = part(closureId);
  const {kind, station_id: station, pad, to_station_id: to} = closure;
  switch (kind) {
    case "STATION": return `/v1/stations/${part(station)}/closures/${id}`;
    case "PAD": return `/v1/stations/${part(station)}/pads/${pad}/outages/${id}`;
    case "SEGMENT": return `/v1/segments/${part(station)}/${part(to)}/closures/${id}`;
    case "ZONE": return `/v1/zones/${id}`;
    default: return `/v1/ground-stops/${id}`;
  }
}

export function closureName({kind, station_id: station, pad, to_station_id: to}) {
  switch (kind) {
    case "STATION": return `Station ${stationName(station)}`;
    case "PAD": return `Pad ${pad} of ${stationName(station)}`;
    case "SEGMENT": return `Segment ${stationName(station)} – ${stationName(to)}`;
    case "ZONE": return "Area";
    default: return "Ground stop";
  }
}

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
    preview: async () => html`<p>${isStop ? STARTED : OPENED}</p>`,
    action: () => call("DELETE", closurePath(closureId, closure)),
    done: isStop ? "The ground stop has ended." : `${name} is open again.`,
  });
}
