// What to do next, while the system has no network, no drone or no delivery; operators can have it done.

import {signal} from "@preact/signals";

import {call, get, post} from "../api.js";
import {html} from "../html.js";
import {connection, picture} from "../live.js";
import {networks} from "../networks.js";
import {pathTo} from "../routes.js";
import {isOperator, session} from "../session.js";
import {useRead, useReadPath} from "../use_read.js";
import {attempt} from "./messages.js";
import {Panel} from "./panel.js";
import {useBusy} from "./use_busy.js";

const publish = async () =>
  call("PUT", "/v1/networks/texas-corridor", await get("/console/bundled-network.json"));

function Begin({text, verb, done, action}) {
  const [isBusy, busy] = useBusy();
  return html`
    <p>${text}</p>
    <button class="main" disabled=${isBusy} onClick=${() => busy(() => attempt(action, done))}>${verb}</button>`;
}

function SmallWorld() {
  const {answer, again} = useReadPath("/v1/system");
  const world = answer?.small_world;
  return html`
    ${world === "AVAILABLE" && html`<${Begin} verb="Start a small world"
      text="See everything move: three simulated fleets in Texas, four shops that order every few seconds, and
        something that happens every few minutes: a closure, a late drone, a gust."
      done="The small world starts. Its drones appear in a moment."
      action=${() => post("/v1/small-world").then(again)} />`}
    ${world === "REQUESTED" && html`<p role="status">The small world starts…</p>`}`;
}

const OperatorsNetwork = () => html`
  <${SmallWorld} />
  <${Begin} verb="Publish the bundled network"
    text="Or begin with stations alone: 56 places between San Marcos and San Antonio."
    done="The network is published." action=${publish} />
  <p>Or publish a network of your own, then register drones:</p>
  <pre>skyway network import network.json --network-id my-city
skyway fleet --drones 12</pre>`;

const OperatorsDrones = () => html`
  <${SmallWorld} />
  <p>Or let simulated drones fly here:</p>
  <pre>skyway fleet --drones 12</pre>
  <p>Or make a key for a provider, who registers drones at <a href=${pathTo("fleet")}>Fleet</a>:
    ${" "}<a href=${pathTo("account")}>Keys</a>.</p>`;

const ProvidersDrones = () => html`
  <p>Register a drone at <a href=${pathTo("fleet")}>Fleet</a>. The token that you get there lets it enrol.</p>`;

const OperatorsDeliveries = () => html`
  <p>Make a key for a customer at <a href=${pathTo("account")}>Keys</a>; with it a customer requests
    deliveries here. Or request one from the command line:</p>
  <pre>skyway request PICKUP --package DESTINATION=0.5</pre>`;

const CustomersDeliveries = () => html`
  <p>Your first delivery takes a minute: say where it goes, compare the offers, and take one.</p>
  <p><a class="button main" href=${pathTo("new")}>New delivery</a></p>`;

// The steps in their order: what is missing, and by role what to do about it.
const STEPS = {
  network: {title: "There is no network yet",
    operator: OperatorsNetwork, other: () => html`<p>An operator has to publish one. Until then there is nothing to fly to:
    ask the people who run this Skyway.</p>`},
  drones: {title: "There is no drone yet", operator: OperatorsDrones, provider: ProvidersDrones},
  deliveries: {title: "Nobody has requested a delivery yet",
    operator: OperatorsDeliveries, customer: CustomersDeliveries},
};

// Whether there was ever a delivery; undefined while that is not known.
const useAnyDelivery = (isAsked) => useRead(async () =>
  isAsked && (await get("/v1/deliveries?limit=1")).items.length > 0, {key: isAsked}).answer ?? undefined;

const isEmpty = (kind) => Object.keys(picture[kind].value).length === 0;

// What is missing, or null. Customers see no drones, and providers no requests.
function useMissing() {
  const {role} = session.value;
  const isKnown = connection.value === "open" && networks.value !== null;
  const hasNetwork = networks.value?.length > 0;
  const lacksDrones = role !== "customer" && isEmpty("drones");
  const mayAsk = role !== "provider" && isKnown && hasNetwork && !lacksDrones;
  const isAnyDelivery = useAnyDelivery(mayAsk && isEmpty("deliveries"));
  if (!isKnown) return null;
  if (!hasNetwork) return "network";
  if (lacksDrones) return "drones";
  return mayAsk && isEmpty("deliveries") && isAnyDelivery === false ? "deliveries" : null;
}

// The step whose hint somebody has closed.
const closed = signal(null);

export function EmptyHint() {
  const missing = useMissing();
  if (missing === null || missing === closed.value) return null;
  const {title, ...hints} = STEPS[missing];
  const hint = isOperator() ? hints.operator : hints[session.value.role] ?? hints.other;
  return hint && html`
    <${Panel} title=${title} label="First steps" kind="empty" onClose=${() => (closed.value = missing)}>
      <${hint} />
    </${Panel}>`;
}
