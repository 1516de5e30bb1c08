// A customer's day: what is on its way and when it comes, and a large button for the next delivery.

import {fleetNow, ticks} from "../fleet_clock.js";
import {html} from "../html.js";
import {connection, picture} from "../live.js";
import {pathTo} from "../routes.js";
import {personName, session} from "../session.js";
import {StateText, isOver} from "../state_words.js";
import {useReadPath} from "../use_read.js";
import {distanceText, durationText, placeName, shortId, zonedText} from "../words.js";
import {Icon} from "./icons.js";
import {WaySketch} from "./way_sketch.js";

const RECENT_AGAIN_MS = 60_000;
const MOST_CARDS = 12;

const openPackages = ({packages}) => Object.values(packages).filter(({delivered_at: done, eta_at: eta}) => eta && !done);
const nextPackage = (delivery) =>
  openPackages(delivery).sort((one, other) => one.eta_at.localeCompare(other.eta_at))[0];

// Running deliveries, the one that comes next first; those without a time are last.
function running() {
  return Object.entries(picture.deliveries.value)
    .map(([id, delivery]) => ({id, delivery, next: nextPackage(delivery)}))
    .sort((one, other) => (one.next?.eta_at ?? "9").localeCompare(other.next?.eta_at ?? "9"));
}

// "12:30" within an hour, "1 h 05 min" before.
function countdown(moment) {
  const left = Math.round((Date.parse(moment) - fleetNow()) / 1000);
  if (left <= 0) return "any moment";
  if (left >= 3_600) return durationText(left);
  return `${Math.floor(left / 60)}:${String(left % 60).padStart(2, "0")}`;
}

function lateText({eta_at: eta, due_at: due}) {
  const late = due ? (Date.parse(eta) - Date.parse(due)) / 1000 : 0;
  return late > 60 ? `${durationText(late)} later than promised` : "as promised";
}

function Coming({next, state}) {
  ticks.value; // read so that it counts down
  if (!next) return html`<p>${state === "SCHEDULED" ? "A drone is chosen when its time comes near."
    : "A drone is being chosen. You need not do anything."}</p>`;
  return html`
    <p class="figure">${countdown(next.eta_at)}</p>
    <p>At ${placeName(next.destination)}, ${zonedText(next.eta_at)}, ${lateText(next)}.</p>`;
}

function DeliveryCard({id, delivery, next}) {
  const {reference, state, mission_ids: missionIds, packages, pickup} = delivery;
  const flown = missionIds.map((each) => [each, picture.missions.value[each]]).find(([, each]) => each) ?? [];
  const [missionId, mission] = flown;
  const drone = Object.values(picture.drones.value).find((each) => each.mission_id === missionId);
  const count = Object.keys(packages).length;
  const done = Object.values(packages).filter((each) => each.delivered_at).length;
  return html`
    <li class="tile feeds-deliveries">
      <h2><a href=${pathTo("deliveries", id)}>${reference ?? `Delivery ${shortId(id)}`}</a>
        <span class="tag"><${StateText} kind="delivery" of=${state} /></span></h2>
      <${Coming} next=${next} state=${state} />
      ${mission && html`<${WaySketch} mission=${mission} drone=${drone}
        label=${`The way from ${placeName(pickup)}${next ? ` to ${placeName(next.destination)}` : ""}`} />`}
      <p class="hint">From ${placeName(pickup)}. ${count === 1 ? "One package." : `${done} of ${count} packages handed over.`}</p>
    </li>`;
}

function Recent() {
  const {answer} = useReadPath("/v1/deliveries?limit=8", {everyMs: RECENT_AGAIN_MS});
  const over = (answer?.items ?? []).filter(({state}) => isOver(state)).slice(0, 5);
  return over.length > 0 && html`
    <section class="tile"><h2>Lately</h2>
      <ul class="lines recent">${over.map(({delivery_id: id, reference, state, updated_at: at}) => html`
        <li key=${id}><a href=${pathTo("deliveries", id)}>${reference ?? `Delivery ${shortId(id)}`}</a>
          ${" "}<${StateText} kind="delivery" of=${state} /> <small>${distanceText(at)}</small></li>`)}</ul>
    </section>`;
}

function greeting() {
  const hour = new Date(fleetNow()).getHours();
  return hour < 5 ? "Hello" : hour < 12 ? "Good morning" : hour < 18 ? "Good afternoon" : "Good evening";
}

function firstSentence(deliveries) {
  if (connection.value !== "open" && deliveries.length === 0) return "Reading your deliveries…";
  if (deliveries.length === 0) return "Nothing is on its way. Say what goes where, and you see offers in seconds.";
  const many = deliveries.length === 1 ? "One delivery is under way" : `${deliveries.length} deliveries are under way`;
  const [{next}] = deliveries;
  return `${many}. ${next ? `The next package arrives ${distanceText(next.eta_at)}.` : "A drone is being chosen."}`;
}

export function CustomerHome() {
  const deliveries = running();
  return html`
    <header class="headline">
      <h1>${greeting()}, ${personName(session.value)}</h1>
      <p>${firstSentence(deliveries)}</p>
      <a class="large-button" href=${pathTo("new")}><${Icon} name="new" /> New delivery</a>
    </header>
    <ul class="tiles" aria-label="Running deliveries">
      ${deliveries.slice(0, MOST_CARDS).map((each) => html`<${DeliveryCard} key=${each.id} ...${each} />`)}
    </ul>
    ${deliveries.length > MOST_CARDS && html`<p><a href=${pathTo("deliveries")}>See all ${deliveries.length} deliveries</a></p>`}
    <${Recent} />`;
}
