// Small charts of the home pages. Each has its numbers as a table for those who do not see it.

import {html} from "../html.js";

// The axis of a chart that has 24 hours.
export const DAY_MARKS = ["00:00", "12:00", "24:00"];

const HEIGHT = 56;
const WIDTH = 240;

const Numbers = ({label, rows}) => html`
  <table class="unseen"><caption>${label}</caption><tbody>
    ${rows.map(([name, text]) => html`<tr key=${name}><th scope="row">${name}</th><td>${text}</td></tr>`)}
  </tbody></table>`;

const Axis = ({marks}) => html`
  <div class="axis" aria-hidden="true">${[marks[0], marks[Math.floor(marks.length / 2)], marks.at(-1)].map((text) => html`
    <span>${text}</span>`)}</div>`;

// A bar for each hour or day: {name, value, text}. The last one is not over; `slots` is how many there will be.
export function Bars({label, bars, slots = bars.length, marks = bars.map(({name}) => name)}) {
  const most = Math.max(...bars.map(({value}) => value), 1);
  const step = WIDTH / Math.max(slots, 1);
  return html`
    <figure class="bars">
      <svg viewBox="0 0 ${WIDTH} ${HEIGHT}" preserveAspectRatio="none" aria-hidden="true">
        <line class="ground" x1="0" x2=${WIDTH} y1=${HEIGHT - 0.5} y2=${HEIGHT - 0.5} />
        ${bars.map(({name, value, text}, number) => {
          const height = value > 0 ? Math.max(3, (value / most) * (HEIGHT - 2)) : 0;
          return html`<rect key=${name} class=${number === bars.length - 1 ? "now" : ""} x=${number * step + step * 0.12}
            y=${HEIGHT - height} width=${step * 0.76} height=${height} rx="1.5"><title>${name}: ${text}</title></rect>`;
        })}
      </svg>
      <${Axis} marks=${marks} />
      <${Numbers} label=${label} rows=${bars.map(({name, text}) => [name, text])} />
    </figure>`;
}

// A cell for each hour of a day, the darker the more: {name, share, text}. Hours that come are empty.
export const Heat = ({label, cells}) => html`
  <figure class="heat">
    <svg viewBox="0 0 240 22" preserveAspectRatio="none" aria-hidden="true">
      ${Array.from({length: 24}, (_, number) => html`
        <rect key=${number} class="cell" x=${number * 10 + 0.4} y="0" width="9.2" height="22" />`)}
      ${cells.map(({name, share, text}, number) => html`
        <rect key=${name} class="filled" x=${number * 10 + 0.4} y="0" width="9.2" height="22" fill-opacity=${share}>
          <title>${name}: ${text}</title></rect>`)}
    </svg>
    <${Axis} marks=${DAY_MARKS} />
    <${Numbers} label=${label} rows=${cells.map(({name, text}) => [name, text])} />
  </figure>`;

// One bar that is split by counts: {name, hint, count, kind}. Its list says the same in words.
export function SplitBar({label, parts}) {
  const shown = parts.filter(({count}) => count > 0);
  const whole = shown.reduce((sum, {count}) => sum + count, 0);
  let from = 0;
  return html`
    <div class="split">
      <svg width="100%" height="12" aria-hidden="true">
        ${whole === 0 && html`<rect class="empty" width="100%" height="12" />`}
        ${shown.map(({name, count, kind}) => {
          const x = from;
          from += count / whole;
          return html`<rect key=${name} class=${kind} x=${`${x * 100}%`} width=${`${(count / whole) * 100}%`} height="12" />`;
        })}
      </svg>
      <ul aria-label=${label}>
        ${shown.map(({name, hint, count, kind}) => html`
          <li key=${name} title=${hint}>
            <svg width="10" height="10" aria-hidden="true"><rect class=${kind} width="10" height="10" rx="3" /></svg>
            <strong>${count}</strong> ${name}</li>`)}
      </ul>
    </div>`;
}

const HOUR_MS = 3_600_000;

// The hours from the beginning of the day up to now, by the clock of this browser.
export function hoursOfToday(nowMs) {
  const first = new Date(nowMs).setHours(0, 0, 0, 0);
  const count = Math.floor((nowMs - first) / HOUR_MS) + 1;
  return Array.from({length: count}, (_, number) => first + number * HOUR_MS);
}

