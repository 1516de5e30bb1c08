// What a provider earned: the sum, and a bar for each day.

import {part} from "../api.js";
import {html} from "../html.js";
import {useReadPath} from "../use_read.js";
import {money} from "../words.js";
import {Promises} from "./promises.js";
import {ShareBar} from "./share_bar.js";
import {Table, unseen} from "./table.js";

const AGAIN_MS = 10_000;

const dayText = ({day}) =>
  new Date(`${day}T12:00:00Z`).toLocaleDateString([], {day: "numeric", month: "short", year: "numeric"});

export function Earnings({providerId}) {
  const {answer: earnings, problem} = useReadPath(`/v1/providers/${part(providerId)}/earnings`, {everyMs: AGAIN_MS});
  if (!earnings) return html`<p class="refused">${problem}</p>`;
  const {currency, amount, deliveries, missions, by_day: days} = earnings;
  if (currency === null) return html`<p class="empty">No mission is settled yet. A mission pays when it ends.</p>`;
  const most = Math.max(...days.map((each) => each.amount), 1);
  return html`
    <p><strong class="sum">${money({amount, currency})}</strong> with ${deliveries}
      ${deliveries === 1 ? " delivery" : " deliveries"} in ${missions} ${missions === 1 ? "mission" : "missions"}.</p>
    <${Table} label="Earnings by day" items=${[...days].reverse()} row=${(each) => ({key: each.day + each.currency})} columns=${[
      ["Day (UTC)", dayText, "title"],
      ["Deliveries", (each) => each.deliveries, "number"],
      ["Missions", (each) => each.missions, "number"],
      ["Earned", money, "number"],
      [unseen("Share of the best day"), (each) => html`<${ShareBar} share=${each.amount / most} />`, "bar wide-cell"],
    ]} />
    <${Promises} providerId=${providerId} />`;
}
