// What the colours of the map mean, and how many drones are where.

import {colours} from "../map/colours.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {pathTo} from "../routes.js";
import {isOperator} from "../session.js";
import {inWords} from "../words.js";

const PADS = [["free", "All pads free"], ["busy", "Some taken"], ["full", "All taken"], ["closed", "Closed"]];

function countsByState() {
  const counts = {};
  for (const {state} of Object.values(picture.drones.value)) {
    if (state) counts[state] = (counts[state] ?? 0) + 1;
  }
  return Object.entries(counts).sort();
}

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
      ${isOperator() && html`<a href=${pathTo("map", "zone")}>Close an area…</a>`}
    </aside>`;
}
