// One row of the schedule: bars with their names, promises as diamonds, and the charge as a line below.

import {fleetNow} from "../fleet_clock.js";
import {html} from "../html.js";
import {pathTo} from "../routes.js";
import {momentText} from "../words.js";

export const ROW_PX = 46;
const BAR_PX = 24;
const CHARGE_PX = 12;
const LETTER_PX = 7.6;

// As much of a text as a bar has room for.
function fitting(text, width) {
  const letters = Math.floor((width - 10) / LETTER_PX);
  if (letters < 3) return "";
  return text.length <= letters ? text : `${text.slice(0, letters - 1)}…`;
}

const spoken = ({name, way, state, start, end}) =>
  `${name}, ${way}, ${momentText(start)} to ${momentText(end)}, ${state}`;

function Bar({bar, y, area, onShow}) {
  const {start, end, kind, href, name} = bar;
  const [left, right] = [Math.max(area.left, area.xOf(start)), Math.min(area.right, area.xOf(end))];
  if (right <= left) return null;
  const width = Math.max(2, right - left);
  const show = () => onShow({bar, x: left, y});
  const drawn = html`
    <g onPointerEnter=${show} onPointerLeave=${() => onShow(null)}>
      <rect class=${kind} x=${left} y=${y} width=${width} height=${BAR_PX} rx="4" />
      <text class="on-bar" x=${left + 5} y=${y + 16} aria-hidden="true">${kind === "standby" ? "" : fitting(name, width)}</text>
    </g>`;
  if (!href) return drawn;
  return html`<a href=${pathTo(...href)} aria-label=${spoken(bar)} onFocus=${show} onBlur=${() => onShow(null)}>${drawn}</a>`;
}

// A diamond where a package is promised: full while it comes in time, hollow when it comes too late.
function Promise({promise: {packageId, at, isMissed}, y, area}) {
  const x = area.xOf(at);
  if (x < area.left || x > area.right) return null;
  return html`
    <path class=${isMissed ? "promise missed" : "promise"} d="M${x} ${y + BAR_PX - 5} l5.5 5.5 l-5.5 5.5 l-5.5 -5.5 Z">
      <title>${packageId} is promised by ${momentText(at)}${isMissed ? " and comes too late" : ""}</title>
    </path>`;
}

// The planned charge from now on, from the measured one; full is at the upper edge.
function chargePoints({charge, soc}, y, area) {
  const now = fleetNow();
  const ahead = charge.filter(([at]) => at > now);
  const points = typeof soc === "number" ? [[now, soc], ...ahead] : ahead;
  return points.filter(([at]) => area.xOf(at) >= area.left && area.xOf(at) <= area.right)
    .map(([at, each]) => `${area.xOf(at).toFixed(1)},${(y + (1 - each) * CHARGE_PX).toFixed(1)}`);
}

export function CalendarRow({row, y, area, onShow}) {
  const points = chargePoints(row, y + BAR_PX + 5, area);
  return html`
    <g class="row">
      <line class="edge" x1="0" x2=${area.right} y1=${y + ROW_PX - 2} y2=${y + ROW_PX - 2} />
      ${points.length > 1 && html`<polyline class="charge" points=${points.join(" ")} />`}
      ${row.bars.map((bar) => html`<${Bar} key=${bar.id} bar=${bar} y=${y + 2} area=${area} onShow=${onShow} />`)}
      ${row.bars.flatMap(({id, promises}) => promises.map((each) => html`
        <${Promise} key=${`${id} ${each.packageId}`} promise=${each} y=${y + 2} area=${area} />`))}
      <a href=${pathTo(...row.href)}>
        <rect class="name" x="0" y=${y} width=${area.left} height=${ROW_PX - 2} />
        <text x="10" y=${y + 18}>${fitting(row.name, area.left)}</text>
        ${typeof row.soc === "number" && html`<text class="soft" x="10" y=${y + 34}>charge ${Math.round(row.soc * 100)} %</text>`}
      </a>
    </g>`;
}
