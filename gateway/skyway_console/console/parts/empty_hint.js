// What to do first, while the system has no network; operators can have it done.

import {useEffect, useState} from "preact/hooks";

import {call, get, post} from "../api.js";
import {html} from "../html.js";
import {isOperator} from "../session.js";
import {attempt} from "./messages.js";

const publish = async () =>
  call("PUT", "/v1/networks/texas-corridor", await get("/console/bundled-network.json"));

function Begin({text, verb, done, action}) {
  const [isBusy, setBusy] = useState(false);
  async function act() {
    setBusy(true);
    await attempt(action, done);
    setBusy(false);
  }
  return html`<p>${text}</p><button class="main" disabled=${isBusy} onClick=${act}>${verb}</button>`;
}

function OperatorsHint() {
  const [world, setWorld] = useState("UNAVAILABLE");
  useEffect(() => {
    get("/v1/system").then(({small_world: state}) => setWorld(state), () => null);
  }, []);
  return html`
    ${world === "AVAILABLE" && html`<${Begin} verb="Start a small world"
      text="See everything move: three simulated fleets in Texas, and a delivery every few seconds."
      done="The small world starts. Its drones appear in a moment."
      action=${() => post("/v1/small-world").then(() => setWorld("REQUESTED"))} />`}
    ${world === "REQUESTED" && html`<p role="status">The small world starts…</p>`}
    <${Begin} verb="Publish the bundled network"
      text="Or begin with stations alone: 56 places between San Marcos and San Antonio."
      done="The network is published." action=${publish} />
    <p>Or publish a network of your own, then register drones:</p>
    <pre>skyway network import network.json --network-id my-city
skyway fleet --drones 12</pre>`;
}

export const EmptyHint = () => html`
  <section class="panel empty" aria-label="First steps">
    <h2>There is no network yet</h2>
    ${isOperator() ? html`<${OperatorsHint} />` : html`<p>An operator has to publish one.</p>`}
  </section>`;
