// The fleet time with its zone, and how fast it runs where it is not wall time.

import {fleetNow, fleetRate, ticks} from "../fleet_clock.js";
import {html} from "../html.js";
import {clockTime, zoneName} from "../words.js";

export function ClockText() {
  ticks.value; // read so that it is drawn each second
  const [now, rate] = [fleetNow(), fleetRate()];
  const day = new Date(now).toLocaleDateString([], {weekday: "long", day: "numeric", month: "long", year: "numeric"});
  const speed = rate === 1 ? "" : `×${Number(rate.toPrecision(3))}`;
  return html`
    <time class="clock" title=${`Fleet time, ${day}`}>${clockTime(now)} <small>${zoneName(now)} ${speed}</small></time>`;
}
