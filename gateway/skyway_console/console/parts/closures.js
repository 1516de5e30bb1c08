// Closures: what one would change, shown before it is made; and lifting one.

import {call, part, post} from "../api.js";
import {html} from "../html.js";
import {distanceText, shortId, stationName} from "../words.js";
import {confirm} from "./confirm_dialog.js";
import {attempt} from "./messages.js";
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

// Asks before something is closed: `path` makes the closure, `order` is what is sent.
export function askToClose(title, path, order = {}) {
  confirm({
    title,
    verb: "Close it",
    preview: async () => affectedText(await post(`${path}?dry_run=true`, {...order, ...DRY_RUN})),
    action: (reason) => post(path, {...order, reason}),
    done: "It is closed. Missions that need it get another plan.",
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

export const lift = (closureId, closure) =>
  attempt(() => call("DELETE", closurePath(closureId, closure)), `${closureName(closure)} is open again.`);
