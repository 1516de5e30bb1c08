// What a delivery's drones do, step by step: planned against real, and why there were new plans.

import {droneName} from "../drone_names.js";
import {fleetNow, ticks} from "../fleet_clock.js";
import {html} from "../html.js";
import {guestsOf, picture} from "../live.js";
import {pathTo} from "../routes.js";
import {session} from "../session.js";
import {useRead} from "../use_read.js";
import {clockTime, distanceText, durationText, inWords, percent, shortId} from "../words.js";
import {endText, stepName} from "./step_list.js";
import {readStory, withEvents} from "./story_steps.js";

// What is nearer to its plan than this is on time, in seconds.
const ON_TIME_S = 30;
const BEFORE_MS = 300_000;

const awayText = (seconds) => (Math.abs(seconds) < ON_TIME_S ? "on time"
  : `${durationText(seconds)} ${seconds > 0 ? "late" : "early"}`);

// What a new plan changes, against the plan before it: the packages that come later or earlier by the same.
export function changeText(packages, before) {
  const moved = packages
    .filter(({later_s: laterS}) => typeof laterS === "number")
    .map(({package_id: id, later_s: laterS}) => [id, Math.round(laterS - (before[id] ?? 0))]);
  return [...new Set(moved.map(([, change]) => change))].map((change) => {
    const ids = moved.filter(([, each]) => each === change).map(([id]) => id).join(", ");
    if (Math.abs(change) < ON_TIME_S) return `${ids} as before`;
    return `${ids} ${durationText(change)} ${change > 0 ? "later" : "earlier"}`;
  }).join("; ");
}

function Step({step, isNext}) {
  const {kind, place, packages, plannedAt, realAt, status, soc} = step;
  const seconds = realAt && (Date.parse(realAt) - Date.parse(plannedAt)) / 1_000;
  const away = seconds === undefined ? "" : awayText(seconds);
  return html`
    <li class=${realAt || status === "ENDED" ? "past" : isNext ? "now" : ""}>
      <span class="what">${stepName(kind, place)}${packages.length > 0 && html` <small>${packages.join(", ")}</small>`}</span>
      <span class="when"><span class="unseen">planned </span>${endText(step, plannedAt)}</span>
      <span class=${seconds > ON_TIME_S ? "real late" : "real"}>
        ${realAt ? `${clockTime(realAt)}, ${away}` : isNext ? distanceText(plannedAt) : ""}
        ${realAt && typeof soc === "number" && html` <small>at ${percent(soc)}</small>`}
      </span>
    </li>`;
}

function NewPlan({plan: {occurred_at: at, data}, before}) {
  const change = changeText(data.packages, before);
  return html`
    <li class="new-plan">
      <strong>New plan at ${clockTime(at)}</strong>: ${data.detail || inWords(data.code).toLowerCase()}.
      ${change && html` <span>${change}.</span>`}
      ${data.given_up && html` <span class="late">Given up: ${inWords(data.given_up)}.</span>`}
    </li>`;
}

const replayPath = (missionBegin, droneId) =>
  pathTo("replay", new Date(Date.parse(missionBegin) - BEFORE_MS).toISOString(), droneId);

function MissionHead({mission, live}) {
  const {mission_id: id, drone_id: drone, start_at: startAt, booked_start_at: bookedAt} = mission;
  const hasBegun = startAt && Date.parse(startAt) < fleetNow();
  const mayReplay = drone && hasBegun && session.value.role !== "customer";
  return html`
    <header class="mission-head"><h3>${drone ? html`<a href=${pathTo("map", "drone", drone)}>Drone ${droneName(drone)}</a>` : "A drone"}
      ${" "}<small>mission ${shortId(id)}</small></h3>
    ${mayReplay && html`<a class="button" href=${replayPath(bookedAt ?? startAt, drone)}>Replay this flight</a>`}</header>
    ${live?.flown_as && html`<p>It is a guest of mission ${shortId(live.flown_as)}.</p>`}
    ${guestsOf(id).length > 0 && html`<p>Guests: ${guestsOf(id).map((each) => html`
      ${" "}<a href=${pathTo("deliveries", each.delivery_id)}>delivery ${shortId(each.delivery_id)}</a>`)}</p>`}`;
}

function Mission({story, events}) {
  ticks.value; // read so that "in 5 min" is right each second
  const {mission} = story;
  const rows = withEvents(story, events);
  const next = rows.find(({kind, realAt, status}) => kind && !realAt && status !== "ENDED");
  return html`
    <section>
      <${MissionHead} mission=${mission} live=${picture.missions.value[mission.mission_id]} />
      ${story.steps.length === 0 && html`<p>Its steps are not known any more.</p>`}
      <ol class="story-steps" aria-label="Planned and real">
        ${rows.map((row, number) => (row.plan
          ? html`<${NewPlan} key=${number} ...${row} />`
          : html`<${Step} key=${number} step=${row} isNext=${row === next} />`))}
      </ol>
    </section>`;
}

// `events` are those of the delivery so far. The missions are read again when one changes or a step ends.
export function DeliveryTimeline({missions, events}) {
  const ended = missions.map(({mission_id: id}) => Object.values(picture.missions.value[id]?.steps ?? {})
    .filter(({status}) => status === "ENDED").length);
  const stories = useRead(() => readStory(missions), {changed: JSON.stringify([missions, ended])}).answer ?? [];
  return html`
    ${missions.length === 0 && html`<p>It has no plan yet. The plan stands here when a drone is booked.</p>`}
    ${missions.length > 0 && html`<p class="hint">A planned time is when a step ends.</p>`}
    ${stories.map((story) => html`<${Mission} key=${story.mission.mission_id} story=${story} events=${events} />`)}`;
}
