// What the colours of the map mean, and how many drones are where.

import {colours} from "../map/colours.js";
import {aheadText, hoursAhead} from "../closed.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {networks, showNetwork, shownNetwork} from "../networks.js";
import {pathTo} from "../routes.js";
import {isOperator} from "../session.js";
import {inWords, stationName} from "../words.js";

const PADS = [["free", "All pads free"], ["busy", "Some taken"], ["full", "All taken"], ["closed", "Closed"]];

function countsByState() {
  const counts = {};
  for (const {state} of Object.values(picture.drones.value)) {
    if (state) counts[state] = (counts[state] ?? 0) + 1;
  }
  return Object.entries(counts).sort();
}

const NetworkChoice = () => networks.value?.length > 0 && html`
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
  const paint = colours();
  const dot = (name) => html`
    <svg width="12" height="12" aria-hidden="true"><circle cx="6" cy="6" r="5" fill=${paint[name]} /></svg>`;
  return html`
    <aside class="legend" aria-label="Legend">
      <ul>${PADS.map(([name, text]) => html`<li>${dot(name)} ${text}</li>`)}</ul>
      <ul class="counts">
        ${countsByState().map(([state, count]) => html`<li>${count} ${inWords(state)}</li>`)}
      </ul>
      <${LookAhead} />
      <${NetworkChoice} />
      ${isOperator() && html`<a href=${pathTo("map", "zone")}>Close an area…</a>`}
    </aside>`;
}
