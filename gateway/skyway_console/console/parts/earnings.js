// What a provider earned: the sum, and a bar for each day.

import {part} from "../api.js";
import {html} from "../html.js";
import {useReadPath} from "../use_read.js";
import {money} from "../words.js";
import {Promises} from "./promises.js";
import {ShareBar} from "./share_bar.js";

const AGAIN_MS = 10_000;

function Day({each, most}) {
  const {day, deliveries, missions, amount, currency} = each;
  return html`
    <tr>
      <td class="title">${new Date(`${day}T12:00:00Z`).toLocaleDateString([], {day: "numeric", month: "short", year: "numeric"})}</td>
      <td class="number" data-label="Deliveries">${deliveries}</td>
      <td class="number" data-label="Missions">${missions}</td>
      <td class="number" data-label="Earned">${money({amount, currency})}</td>
      <td class="bar wide-cell"><${ShareBar} share=${amount / most} kind="price" /></td>
    </tr>`;
}

export function Earnings({providerId}) {
  const {answer: earnings, problem} = useReadPath(`/v1/providers/${part(providerId)}/earnings`, {everyMs: AGAIN_MS});
  if (!earnings) return html`<p class="refused">${problem}</p>`;
  const {currency, amount, deliveries, missions, by_day: days} = earnings;
  if (currency === null) return html`<p class="empty">No mission is settled yet. A mission pays when it ends.</p>`;
  const most = Math.max(...days.map((each) => each.amount), 1);
  return html`
    <p><strong class="sum">${money({amount, currency})}</strong> with ${deliveries}
      ${deliveries === 1 ? " delivery" : " deliveries"} in ${missions} ${missions === 1 ? "mission" : "missions"}.</p>
    <div class="table"><table class="as-cards" aria-label="Earnings by day">
      <thead><tr><th>Day (UTC)</th><th>Deliveries</th><th>Missions</th><th>Earned</th>
        <th><span class="unseen">Share of the best day</span></th></tr></thead>
      <tbody>${[...days].reverse().map((each) => html`<${Day} key=${each.day + each.currency} each=${each} most=${most} />`)}</tbody>
    </table></div>
    <${Promises} providerId=${providerId} />`;
}
