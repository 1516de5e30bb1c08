// What the signs of the map mean, how many drones are where, and what is closed ahead. On a phone it is a
// sheet behind a button.

import {useState} from "preact/hooks";

import {aheadText, hoursAhead} from "../closed.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {networks, showNetwork, shownNetwork} from "../networks.js";
import {pathTo} from "../routes.js";
import {isOperator} from "../session.js";
import {StateText} from "../state_words.js";
import {stationName} from "../words.js";

// The class of a sign in styles/map.css, and what it means.
const STATIONS = [
  ["free", "Free pads of all pads"], ["full", "All pads taken"], ["congested", "More bookings than pads"],
  ["closed", "Closed"], ["parking", "No pads, parking only"],
];

// The ring of free pads as a picture: how much of its circle is drawn, out of 100.
const SHARES = {free: 75, full: 100, congested: 60, closed: 0, parking: 0};

function StationSign({kind}) {
  if (kind === "parking") {
    return html`<svg class="sign parking" viewBox="0 0 20 20" aria-hidden="true">
      <rect x="4" y="4" width="12" height="12" rx="2" /></svg>`;
  }
  return html`
    <svg class="sign ${kind}" viewBox="0 0 20 20" aria-hidden="true">
      <circle class="rest" cx="10" cy="10" r="7" />
      <circle class="share" cx="10" cy="10" r="7" pathLength="100" stroke-dasharray="${
        kind === "congested" ? "8 6 8 6 8 6 8 100" : `${SHARES[kind]} 100`}" transform="rotate(-90 10 10)" />
      ${kind === "closed" && html`<path class="cross" d="M7 7l6 6M13 7l-6 6" />`}
    </svg>`;
}

function countsByState() {
  const counts = {};
  for (const {state} of Object.values(picture.drones.value)) {
    if (state) counts[state] = (counts[state] ?? 0) + 1;
  }
  return Object.entries(counts).sort();
}

const NetworkChoice = () => networks.value?.length > 1 && html`
  <select aria-label="Network" value=${shownNetwork.value}
    onChange=${({target}) => showNetwork(target.value)}>
    ${networks.value.map(({network_id: id}) => html`<option value=${id}>${stationName(id)}</option>`)}
  </select>`;

// Closures and areas can be seen ahead; drones and pads are shown as they are now.
const LookAhead = () => html`
  <label class="ahead">Closures ${aheadText()}
    <input type="range" min="0" max="48" step="0.5" value=${hoursAhead.value}
      onInput=${({target}) => (hoursAhead.value = Number(target.value))} />
  </label>`;

export function MapLegend() {
  const [isOpen, setOpen] = useState(false);
  return html`
    <button class="legend-button" aria-expanded=${isOpen} onClick=${() => setOpen(!isOpen)}>Legend</button>
    <aside class="legend ${isOpen ? "open" : ""}" aria-label="Legend">
      <ul class="signs">
        ${STATIONS.map(([kind, text]) => html`<li><${StationSign} kind=${kind} /> ${text}</li>`)}
      </ul>
      <ul class="counts" aria-label="Drones by state">
        ${countsByState().map(([state, count]) => html`<li><span>${count}</span> <${StateText} kind="drone" of=${state} /></li>`)}
      </ul>
      <div class="legend-more">
        <${LookAhead} />
        <${NetworkChoice} />
        ${isOperator() && html`<a class="close-area" href=${pathTo("map", "zone")}>Close an area…</a>`}
      </div>
    </aside>`;
}
