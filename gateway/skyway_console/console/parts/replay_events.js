// What happened in a past hour, in time order: alarms, closures, landings and new plans of the chosen drone.

import {droneName} from "../drone_names.js";
import {inWords} from "../words.js";
import {closureName} from "./closures.js";
import {isStill} from "./flight_record.js";

// The moments at which a drone has come to stand.
function landingsOf(samples) {
  return samples.slice(1, -1).filter((sample, number) =>
    !isStill(samples[number].position, sample.position) && isStill(sample.position, samples[number + 2].position)).map(({atMs}) => atMs);
}

function closureEvents({closure_id: id, kind, fromMs, untilMs, ...closure}) {
  const name = closureName({kind, ...closure});
  const isStop = kind === "GROUND_STOP";
  return [
    {id, kind: "closure", atMs: fromMs, text: isStop ? `${name} begins` : `${name} closed`},
    {id: `${id} end`, kind: "closure", atMs: untilMs, text: isStop ? `${name} ends` : `${name} open again`},
  ];
}

// `plans` are those of the drone that is chosen; without one its landings are left out too.
export function eventsOf({alarms, closures, record}, plans, droneId, span) {
  const landings = landingsOf(record.get(droneId) ?? []);
  return [
    ...alarms.map(({alarm_id: id, at, code, drone_id: drone}) => (
      {id, kind: "alarm", atMs: Date.parse(at), text: `${inWords(code)}${drone ? `, ${droneName(drone)}` : ""}`})),
    ...closures.flatMap(closureEvents),
    ...landings.map((atMs) => ({id: `landing ${atMs}`, kind: "landing", atMs, text: `${droneName(droneId)} lands`})),
    ...plans.map(({mission_id: id, mission_revision: revision, sent_at: at}) => ({
      id: `${id} ${revision}`, kind: "plan", atMs: Date.parse(at),
      text: revision > 1 ? `New plan ${revision} of ${droneName(droneId)}` : `${droneName(droneId)} gets a mission`,
    })),
  ].filter(({atMs}) => atMs >= span.from && atMs <= span.until).sort((one, other) => one.atMs - other.atMs);
}
