// What to do first, while the system has no network.

import {html} from "../html.js";

export const EmptyHint = () => html`
  <section class="panel empty">
    <h2>There is no network yet</h2>
    <p>Publish a network of stations and segments, then register drones:</p>
    <pre>skyway network build > network.json
skyway network import network.json --network-id texas-corridor
skyway fleet --drones 12</pre>
    <p>They appear here by themselves.</p>
  </section>`;
