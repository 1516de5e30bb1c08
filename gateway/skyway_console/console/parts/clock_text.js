// The fleet time, and how fast it runs where it is not wall time.

import {fleetNow, fleetRate, ticks} from "../fleet_clock.js";
import {html} from "../html.js";

export function ClockText() {
  ticks.value; // read so that it is drawn each second
  const rate = fleetRate();
  const time = new Date(fleetNow()).toLocaleTimeString([], {
    hour: "2-digit", minute: "2-digit", second: "2-digit", hourCycle: "h23",
  });
  const speed = rate === 1 ? "" : ` ×${Number(rate.toPrecision(3))}`;
  return html`<time class="clock" title="Fleet time">${time}${speed}</time>`;
}
