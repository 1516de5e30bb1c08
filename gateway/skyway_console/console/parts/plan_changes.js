// Which plans were replaced in the last hour, and what that changed: from the plans that drones were sent.

import {droneName} from "../drone_names.js";
import {fleetNow} from "../fleet_clock.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {pathTo} from "../routes.js";
import {useRead} from "../use_read.js";
import {shortId, momentText} from "../words.js";
import {changeText} from "./delivery_timeline.js";
import {readPlans} from "./past_plans.js";

const HOUR_MS = 3_600_000;
// The hour before, so that a plan of the last hour can be compared with the plan before it.
const BEFORE_MS = 4 * HOUR_MS;
const MOST_DRONES = 20;

const handOvers = (steps) => steps.filter(({kind}) => kind === "DELIVER").flatMap(
  ({package_ids: ids, planned_end_at: at}) => ids.map((id) => ({package_id: id, later_s: Date.parse(at) / 1_000})));

// The new plans among those of one drone, with the packages that come later or earlier by them.
function changesOf(droneId, plans, sinceMs) {
  const steps = {};
  return plans.flatMap(({mission_id: missionId, sent_at: sentAt, mission_revision: revision, first_step: first, steps: newer}) => {
    const earlier = steps[missionId];
    // A plan goes on from the steps that it leaves as they are.
    steps[missionId] = [...(earlier ?? []).filter(({step_id: id}) => id < first), ...newer];
    if (!earlier || Date.parse(sentAt) < sinceMs) return [];
    const before = Object.fromEntries(handOvers(earlier).map(({package_id: id, later_s: laterS}) => [id, laterS]));
    const known = handOvers(steps[missionId]).filter(({package_id: id}) => id in before);
    return [{droneId, missionId, sentAt, revision, text: changeText(known, before) || "It delivers nothing."}];
  });
}

async function readChanges() {
  const now = fleetNow();
  const drones = new Set(Object.values(picture.missions.value)
    .filter(({revision, drone_id: id}) => revision > 1 && id).map(({drone_id: id}) => id));
  const found = await Promise.all([...drones].slice(0, MOST_DRONES).map(async (id) =>
    changesOf(id, await readPlans(id, {from: now - BEFORE_MS, until: now}), now - HOUR_MS)));
  return found.flat().sort((one, other) => other.sentAt.localeCompare(one.sentAt));
}

export function PlanChanges() {
  const revisions = Object.entries(picture.missions.value).filter(([, {revision}]) => revision > 1)
    .map(([id, {revision}]) => `${id} ${revision}`).join();
  const changes = useRead(readChanges, {changed: revisions}).answer ?? [];
  return html`
    <h2>New plans of the last hour</h2>
    ${changes.length === 0 && html`<p>No mission that goes on got another plan.</p>`}
    <ul class="timeline" aria-label="New plans of the last hour">
      ${changes.map(({droneId, missionId, sentAt, revision, text}) => {
        const delivery = picture.missions.value[missionId]?.delivery_id;
        return html`
          <li key=${`${missionId} ${revision}`}><time>${momentText(sentAt)}</time>
            <strong>${droneName(droneId)}</strong>, plan ${revision} of
            ${" "}${delivery ? html`<a href=${pathTo("deliveries", delivery)}>delivery ${shortId(delivery)}</a>`
              : `mission ${shortId(missionId)}`}<br /><small>${text}</small></li>`;
      })}
    </ul>`;
}
