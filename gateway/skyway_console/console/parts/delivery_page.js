// One delivery: packages with promise and ETA, the reasons, what happened, the proof, the plan.

import {useEffect, useState} from "preact/hooks";

import {get, post} from "../api.js";
import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {guestsOf, picture} from "../live.js";
import {pathTo} from "../routes.js";
import {isOperator, session} from "../session.js";
import {inWords, money, momentText, shortId, stationName} from "../words.js";
import {confirm} from "./confirm_dialog.js";
import {DeliveryAudit} from "./delivery_audit.js";
import {DeliveryEvents} from "./delivery_events.js";
import {Facts} from "./facts.js";
import {HandOverProofs} from "./hand_over_proofs.js";
import {StepList} from "./step_list.js";
import {TrackingBox} from "./tracking_box.js";

const LATE_MS = 60_000;

export const isLate = ({due_at: promised, eta_at: eta, delivered_at: delivered}) =>
  promised && (delivered ?? eta) && Date.parse(delivered ?? eta) - Date.parse(promised) > LATE_MS;

function useDelivery(path, deliveryId) {
  const [delivery, setDelivery] = useState(null);
  const [proof, setProof] = useState(null);
  const [problem, setProblem] = useState("");
  // The live picture says when the delivery has changed.
  const live = picture.deliveries.value[deliveryId];
  const read = () => void get(path).then(setDelivery, (refusal) => setProblem(refusal.message));
  useEffect(read, [path, live]);
  const handedOver = delivery?.packages.filter(({delivered_at}) => delivered_at).length ?? 0;
  useEffect(() => {
    if (handedOver > 0) get(`${path}/proof`).then(setProof, () => null);
  }, [path, handedOver]);
  return {delivery, proof, problem, read};
}

function Packages({packages}) {
  return html`
    <div class="table"><table aria-label="Packages">
      <thead><tr><th>Package</th><th>To</th><th>State</th><th>Promised</th><th>Expected</th><th>Why</th></tr></thead>
      <tbody>
        ${packages.map((each) => html`
          <tr key=${each.package_id} class=${isLate(each) ? "late" : ""}>
            <td>${each.package_id}</td>
            <td>${each.destination?.station_id ? stationName(each.destination.station_id) : ""}</td>
            <td>${inWords(each.state)}</td>
            <td>${each.due_at ? momentText(each.due_at) : ""}</td>
            <td class="eta">${each.delivered_at
              ? `handed over ${momentText(each.delivered_at)}`
              : each.eta_at ? momentText(each.eta_at) : ""}</td>
            <td>${each.code ? inWords(each.code) : ""} ${each.detail ?? ""}</td>
          </tr>`)}
      </tbody>
    </table></div>`;
}

function Missions({missions}) {
  return missions.map(({mission_id, drone_id}) => {
    const live = picture.missions.value[mission_id];
    return html`
      <section key=${mission_id}>
        <h3>Mission ${shortId(mission_id)}${drone_id && html` of
          ${" "}<a href=${pathTo("map", "drone", drone_id)}>drone ${droneName(drone_id)}</a>`}</h3>
        ${live?.flown_as && html`<p>It is a guest of mission ${shortId(live.flown_as)}.</p>`}
        ${guestsOf(mission_id).length > 0 && html`<p>Guests: ${guestsOf(mission_id).map((each) => html`
          ${" "}<a href=${pathTo("deliveries", each.delivery_id)}>delivery ${shortId(each.delivery_id)}</a>`)}</p>`}
        ${live ? html`<${StepList} mission=${live} />` : html`<p>It is over.</p>`}
      </section>`;
  });
}

// Packages that are not handed over have no moment in the proof.
function Proof({proof}) {
  const proven = (proof?.packages ?? []).filter(({at}) => at);
  return proven.length > 0 && html`
    <h2>Proof</h2>
    <ul class="timeline" aria-label="Proof">
      ${proven.map(({package_id, station_id, at, mass_kg: massKg}) => html`
        <li key=${package_id}><time>${momentText(at)}</time>${package_id} handed over
          ${station_id ? ` at ${stationName(station_id)}` : ""}${
          massKg === null || massKg === undefined ? "" : `, ${Number(massKg.toFixed(3))} kg`}</li>`)}
    </ul>`;
}

const askToCancel = (path, deliveryId) => confirm({
  title: `Cancel delivery ${shortId(deliveryId)}`,
  verb: "Cancel the delivery",
  reason: "optional",
  preview: async () => html`<p>Packages that wait are not picked up. Packages on board are brought back
    to the pickup. What was handed over stays there.</p>`,
  action: (reason) => post(`${path}/cancel`, reason ? {reason} : {}),
  done: "The delivery is being cancelled.",
});

const OVER = ["COMPLETED", "PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED"];

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
  return OVER.includes(state) ? "no" : "possible until the drone is loaded";
}

export function DeliveryPage({deliveryId, path: part}) {
  const path = `/v1/deliveries/${part}`;
  const {delivery, proof, problem, read} = useDelivery(path, deliveryId);
  if (!delivery) return html`<div class="page"><p class="refused">${problem}</p></div>`;
  const live = picture.deliveries.value[deliveryId];
  const {state, activity, code, detail, request, pickup, price, provider_id: provider} = {...delivery, ...live};
  const missions = delivery.missions ?? [];
  const packages = delivery.packages.map((each) => ({...each, ...live?.packages?.[each.package_id]}));
  return html`
    <div class="page">
      <p><a href=${pathTo("deliveries")}>All deliveries</a></p>
      <h1>Delivery ${shortId(deliveryId)}</h1>
      <${Facts} of=${[
        ["Id", deliveryId],
        ["Reference", delivery.reference],
        ["Customer", delivery.customer_id],
        ["State", `${inWords(state)}${activity ? `, ${inWords(activity).toLowerCase()}` : ""}`],
        ["Why", code && `${inWords(code)}${detail ? `: ${detail}` : ""}`],
        ["Pickup", pickupText(pickup, request)],
        ["Wanted", request.qos?.objective && inWords(request.qos.objective)],
        ["Price", price && money(price)],
        ["Shared trip", sharedText(request, missions, state)],
        ["Provider", provider],
        ["Requested", momentText(delivery.created_at)],
      ]} />
      ${!OVER.includes(state) && html`<button onClick=${() => askToCancel(path, deliveryId)}>Cancel the delivery</button>`}
      <h2>Packages</h2>
      <${Packages} packages=${packages} />
      <${HandOverProofs} packages=${packages} path=${path} onGiven=${read} />
      <div class="columns">
        <section><h2>What happened</h2><${DeliveryEvents} path=${path} onProofAwaited=${read} /><${Proof} proof=${proof} /></section>
        <section><h2>Plan</h2><${Missions} missions=${missions} />
          ${session.value.role === "customer" && html`<${TrackingBox} path=${path} />`}
          ${isOperator() && html`<${DeliveryAudit} path=${path} missions=${missions}
            changed=${`${state} ${activity}`} />`}</section>
      </div>
    </div>`;
}
