// The steps of a delivery's missions, planned against real, with the new plans between them.

import {get, part} from "../api.js";
import {session} from "../session.js";

// Operators see what drones reported. Customers see the plan, and when their packages were handed over.
export async function readStory(missions) {
  if (session.value.role === "customer") return missions.filter(({plan}) => plan).map(plannedOnly);
  const records = await Promise.all(missions.map(({mission_id: id}) =>
    get(`/v1/missions/${part(id)}`).catch(() => null)));
  return records.map((record, number) => ({mission: missions[number], steps: (record?.steps ?? []).map(reported)}));
}

const placeOf = ({to, station_id: station}) => to ?? station;

function reported({step, revision, status, event}) {
  return {
    kind: step.kind, lands: step.lands, place: placeOf(step), revision, status,
    packages: step.package_ids ?? (step.packages ?? []).map(({package_id: id}) => id),
    plannedAt: step.planned_end_at,
    realAt: status === "ENDED" ? event?.ended_at : undefined,
    soc: event?.soc,
  };
}

function plannedOnly(mission) {
  const startMs = Date.parse(mission.start_at);
  return {mission, steps: mission.plan.steps.map((step) => ({
    kind: step.kind, place: placeOf(step), revision: mission.revision, packages: step.package_ids ?? [],
    plannedAt: new Date(startMs + step.end_s * 1_000).toISOString(),
  }))};
}

// The steps with what the events of the delivery say of them: new plans before their first step, and
// when packages were handed over.
export function withEvents({mission, steps}, events) {
  const own = events.filter(({data}) => data.mission_id === mission.mission_id);
  const handedOver = Object.fromEntries(own.filter(({type}) => type === "package.delivered")
    .map(({data, occurred_at: at}) => [data.package_id, at]));
  const loadedAt = own.find(({type}) => type === "delivery.loaded")?.occurred_at;
  const plans = own.filter(({type}) => type === "delivery.replanned");
  let shown = 0;
  const rows = steps.flatMap((step) => {
    const newer = plans.slice(shown).filter(({data}) => data.revision <= step.revision);
    shown += newer.length;
    const happened = step.kind === "DELIVER" ? handedOver[step.packages[0]] : step.kind === "PICK_UP" && loadedAt;
    return [...newer.map((plan) => ({plan, before: before(plans, plan)})),
      {...step, realAt: step.realAt ?? (happened || undefined)}];
  });
  return [...rows, ...plans.slice(shown).map((plan) => ({plan, before: before(plans, plan)}))];
}

// How much later than booked each package was in the plan before, in seconds.
function before(plans, plan) {
  const earlier = plans.slice(0, plans.indexOf(plan)).flatMap(({data}) => data.packages);
  return Object.fromEntries(earlier.map(({package_id: id, later_s: laterS}) => [id, laterS]));
}
