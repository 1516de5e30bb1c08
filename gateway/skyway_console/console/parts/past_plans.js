// What was closed in a past hour, and what drones had to fly: from composition's record.

import {all, get, part, spanQuery} from "../api.js";

const MOST_CLOSURES = 500;

const endMs = (moment) => (moment ? Date.parse(moment) : Infinity);

// What was closed at some moment of the span.
export async function readClosures(span) {
  const closures = await all(`/v1/closures?${spanQuery(span.from, span.until)}`, MOST_CLOSURES);
  return closures.map((each) => ({
    ...each,
    station_id: each.from_id ?? each.station_id,
    to_station_id: each.to_id,
    rings: each.area?.coordinates,
    fromMs: Date.parse(each.from_at),
    untilMs: Math.min(endMs(each.until), endMs(each.lifted_at)),
  }));
}

// What was closed at a moment, by id, as the live picture has it.
export const closuresAt = (closures, atMs) => Object.fromEntries(closures
  .filter(({fromMs, untilMs}) => fromMs <= atMs && atMs < untilMs)
  .map((each) => [each.closure_id, each]));

// The plans of the missions that a drone had in the span, in the order in which they were sent.
export async function readPlans(droneId, span) {
  const {plans} = await get(`/v1/drones/${part(droneId)}/plans?${spanQuery(span.from, span.until)}`);
  return plans.filter(({is_accepted: isAccepted}) => isAccepted);
}

// What a drone had to fly at a moment, as the map draws a mission; null without a mission.
export function missionAt(plans, atMs) {
  const sent = plans.filter(({sent_at: sentAt}) => Date.parse(sentAt) <= atMs);
  const missionId = sent.at(-1)?.mission_id;
  let steps = [];
  for (const plan of sent.filter(({mission_id: id}) => id === missionId)) {
    steps = [...steps.filter(({step_id: id}) => id < plan.first_step), ...plan.steps];
  }
  if (steps.length === 0 || Date.parse(steps.at(-1).planned_end_at) < atMs) return null;
  return {steps: steps.map((step) => ({
    ...step,
    position: step.to_position,
    status: Date.parse(step.planned_end_at) <= atMs ? "ENDED" : "PLANNED",
  }))};
}
