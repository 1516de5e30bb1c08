// The schedule on a phone: one drone or pad after the other, with what comes next.

import {fleetNow} from "../fleet_clock.js";
import {html} from "../html.js";
import {pathTo} from "../routes.js";
import {distanceText, momentText, percent} from "../words.js";

const SHOWN = 3;

const Trip = ({bar: {name, state, start, end, href, kind, promises}}) => html`
  <li>
    <span class="swatch ${kind}"></span>
    <div>
      ${href ? html`<a href=${pathTo(...href)}>${name}</a>` : name}
      <br /><small>${momentText(start)} to ${momentText(end)}, ${state.toLowerCase()}${
        start > fleetNow() ? `, ${distanceText(new Date(start).toISOString())}` : ""}</small>
      ${promises.some(({isMissed}) => isMissed) && html`<br /><small class="late">Comes later than promised</small>`}
    </div>
  </li>`;

function Card({row: {name, href, soc, bars}}) {
  const next = bars.filter(({end, kind}) => end > fleetNow() && kind !== "standby")
    .sort((one, other) => one.start - other.start);
  return html`
    <li class="trip-card">
      <h2><a href=${pathTo(...href)}>${name}</a>${typeof soc === "number" && html` <small>charge ${percent(soc)}</small>`}</h2>
      <ul>
        ${next.slice(0, SHOWN).map((bar) => html`<${Trip} key=${bar.id} bar=${bar} />`)}
        ${next.length === 0 && html`<li><small>Free. Nothing is booked.</small></li>`}
        ${next.length > SHOWN && html`<li><small>and ${next.length - SHOWN} more</small></li>`}
      </ul>
    </li>`;
}

export const TripCards = ({rows}) => html`
  <ul class="trip-cards" aria-label="Next trips">${rows.map((row) => html`<${Card} key=${row.id} row=${row} />`)}</ul>`;
