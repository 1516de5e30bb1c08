// The story of one delivery: its way on the map, what is next, planned against real with the reasons, packages,
// price, proof, and what happened.

import {get, post} from "../api.js";
import {ticks} from "../fleet_clock.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {pathTo} from "../routes.js";
import {isOperator, session} from "../session.js";
import {DeliveryStateText, isOver} from "../state_words.js";
import {useRead, useReadPath} from "../use_read.js";
import {distanceText, inWords, momentText, shortId, stationName, wordsOfId} from "../words.js";
import {confirm} from "./confirm_dialog.js";
import {DeliveryAudit} from "./delivery_audit.js";
import {DeliveryEvents, useDeliveryEvents} from "./delivery_events.js";
import {DeliveryPackages, againstPromise, isLate} from "./delivery_packages.js";
import {DeliveryPrice} from "./delivery_price.js";
import {DeliveryTimeline} from "./delivery_timeline.js";
import {DeliveryWay} from "./delivery_way.js";
import {DeliveryWebhooks} from "./delivery_webhooks.js";
import {Facts} from "./facts.js";
import {Fold} from "./fold.js";
import {HandOverProofs} from "./hand_over_proofs.js";
import {TrackingBox} from "./tracking_box.js";

function useDelivery(path, deliveryId) {
  // The live picture says when the delivery has changed.
  const {answer: delivery, problem, again: read} = useReadPath(path, {changed: picture.deliveries.value[deliveryId]});
  const handedOver = delivery?.packages.filter(({delivered_at}) => delivered_at).length ?? 0;
  const {answer: proof} = useRead(async () => handedOver > 0 && get(`${path}/proof`), {key: path, changed: handedOver});
  return {delivery, proof, problem, read};
}

// Packages that are not handed over have no moment in the proof.
function Proof({proof}) {
  const proven = (proof?.packages ?? []).filter(({at}) => at);
  return proven.length > 0 && html`
    <${Fold} title="Proof"><ul class="timeline" aria-label="Proof">
      ${proven.map(({package_id, station_id, at, mass_kg: massKg}) => html`
        <li key=${package_id}><time>${momentText(at)}</time>${package_id} handed over
          ${station_id ? ` at ${stationName(station_id)}` : ""}${
          massKg === null || massKg === undefined ? "" : `, ${Number(massKg.toFixed(3))} kg`}</li>`)}
    </ul></${Fold}>`;
}

const askToCancel = (path, deliveryId) => confirm({
  title: `Cancel delivery ${shortId(deliveryId)}`,
  verb: "Cancel the delivery",
  reason: "optional",
  meaning: "Packages that wait are not picked up. Packages on board are brought back to the pickup. "
    + "What was handed over stays there.",
  action: (reason) => post(`${path}/cancel`, reason ? {reason} : {}),
  done: "The delivery is being cancelled.",
});

// The station where the packages are handed over to the drone. It may be another one than was asked for.
function pickupText({station_id: stationId}, {pickup: asked}) {
  if (!stationId) return null;
  const name = stationName(stationId);
  return stationId === asked?.station_id ? name : `${name}: the packages are handed over there, not at ${
    stationName(asked.station_id)}`;
}

// Whether packages of others fly with the delivery; a customer learns no more about them.
function sharedText({qos}, missions, state) {
  if (missions.some((each) => each.is_pooled)) return "yes, at the lower price";
  if (!qos?.pooling) return null;
  return isOver(state) ? "no" : "possible until the drone is loaded";
}

const whyText = (code, detail) => code && `${inWords(code)}${detail ? `: ${detail}` : ""}`;

// "from McQueeney to Geronimo, Marion".
function wayText({pickup}, packages) {
  const names = packages.map(({destination}) => destination?.station_id).filter(Boolean).map(stationName);
  return `${pickup?.station_id ? `from ${stationName(pickup.station_id)} ` : ""}to ${[...new Set(names)].join(", ")}`;
}

// What matters now, in a sentence: the next hand-over, or how it has ended.
function headline({state, code, detail}, packages) {
  const areHandedOver = packages.length > 0 && packages.every(({delivered_at: at}) => at);
  if (isOver(state) || areHandedOver) {
    const last = packages.filter(({delivered_at: at}) => at)
      .sort((one, other) => one.delivered_at.localeCompare(other.delivered_at)).at(-1);
    if (!last) return whyText(code, detail);
    return `The last package was handed over at ${momentText(last.delivered_at)}${
      last.due_at ? `, ${againstPromise(last)}` : ""}.`;
  }
  const next = packages.filter(({delivered_at: at, eta_at: eta}) => !at && eta)
    .sort((one, other) => one.eta_at.localeCompare(other.eta_at))[0];
  if (!next) return "There is no plan yet.";
  return `Next: ${next.package_id} at ${stationName(next.destination.station_id)} at ${momentText(next.eta_at)}, ${
    distanceText(next.eta_at)}, ${againstPromise(next) || "without a promise"}.`;
}

function Head({deliveryId, delivery, packages, onCancel}) {
  ticks.value; // read so that "in 5 min" is right each second
  const {state, activity, reference, customer_id: customer} = delivery;
  const isLateNow = packages.some(isLate);
  return html`
    <p><a href=${pathTo("deliveries")}>All deliveries</a></p>
    <header class="story-head">
      <h1>${reference || `Delivery ${shortId(deliveryId)}`}</h1>
      <p><span class="tag ${isLateNow ? "WARNING" : isOver(state) ? "" : "MOVING"}"><${
        DeliveryStateText} state=${state} activity=${activity} /></span>
        ${" "}for ${wordsOfId(customer)}, ${wayText(delivery, packages)}, requested ${momentText(delivery.created_at)}</p>
      <p class="headline">${headline(delivery, packages)}</p>
      ${!isOver(state) && html`<button onClick=${onCancel}>Cancel the delivery</button>`}
    </header>`;
}

const factsOf = (deliveryId, delivery, missions) => [
  ["Id", deliveryId],
  ["Reference", delivery.reference],
  ["Customer", delivery.customer_id],
  ["Why", whyText(delivery.code, delivery.detail)],
  ["Pickup", pickupText(delivery.pickup, delivery.request)],
  ["Wanted", delivery.request.qos?.objective && inWords(delivery.request.qos.objective)],
  ["Shared trip", sharedText(delivery.request, missions, delivery.state)],
  ["Provider", delivery.provider_id],
];

const NO_MISSIONS = [];

export function DeliveryPage({deliveryId, path: part}) {
  const path = `/v1/deliveries/${part}`;
  const {delivery: read, proof, problem, read: readAgain} = useDelivery(path, deliveryId);
  const events = useDeliveryEvents(path, readAgain);
  if (!read) return html`<div class="page"><p class="refused">${problem}</p></div>`;
  const live = picture.deliveries.value[deliveryId];
  const packages = read.packages.map((each) => ({...each, ...live?.packages?.[each.package_id]}));
  const delivery = {...read, ...live, packages};
  const missions = read.missions ?? NO_MISSIONS;
    return html`
    <div class="page story">
      <${Head} deliveryId=${deliveryId} delivery=${delivery} packages=${packages}
        onCancel=${() => askToCancel(path, deliveryId)} />
      <div class="story-columns">
        <div>
          <${DeliveryWay} path=${path} isOver=${isOver(delivery.state)} />
          <${Fold} title="Packages" isFirst><${DeliveryPackages} packages=${packages} recipient=${read.recipient} /></${Fold}>
          <${HandOverProofs} packages=${packages} path=${path} onGiven=${readAgain} />
          <${Proof} proof=${proof} />
          <${Fold} title="Price"><${DeliveryPrice} deliveryId=${deliveryId} price=${delivery.price}
            changed=${delivery.state} /></${Fold}>
          <${Fold} title="About it"><${Facts} of=${factsOf(deliveryId, delivery, missions)} /></${Fold}>
        </div>
        <div>
          <${Fold} title="Planned and real" isFirst><${DeliveryTimeline} missions=${missions} events=${events} /></${Fold}>
          ${session.value.role === "customer" && html`<${TrackingBox} path=${path} />`}
          <${Fold} title="What happened"><${DeliveryEvents} events=${events} /></${Fold}>
          <${Fold} title="Webhooks" isOpen=${false}><${DeliveryWebhooks} events=${events} /></${Fold}>
          ${isOperator() && html`<${DeliveryAudit} path=${path} missions=${missions}
            changed=${`${delivery.state} ${delivery.activity}`} />`}
        </div>
      </div>
    </div>`;
}
