// What a provider earned: the sum, and a bar for each day.

import {useEffect, useState} from "preact/hooks";

import {get, part} from "../api.js";
import {html} from "../html.js";
import {money} from "../words.js";
import {Promises} from "./promises.js";
import {ShareBar} from "./share_bar.js";

const AGAIN_MS = 10_000;

function useEarnings(providerId) {
  const [earnings, setEarnings] = useState(null);
  const [problem, setProblem] = useState("");
  useEffect(() => {
    const read = () => get(`/v1/providers/${part(providerId)}/earnings`).then(
      (answer) => (setEarnings(answer), setProblem("")), (refusal) => setProblem(refusal.message));
    read();
    const timer = setInterval(read, AGAIN_MS);
    return () => clearInterval(timer);
  }, [providerId]);
  return {earnings, problem};
}

function Day({each, most}) {
  const {day, deliveries, missions, amount, currency} = each;
  return html`
    <tr>
      <td>${new Date(`${day}T12:00:00Z`).toLocaleDateString([], {day: "numeric", month: "short", year: "numeric"})}</td>
      <td class="number">${deliveries}</td>
      <td class="number">${missions}</td>
      <td class="number">${money({amount, currency})}</td>
      <td class="bar"><${ShareBar} share=${amount / most} kind="price" /></td>
    </tr>`;
}

export function Earnings({providerId}) {
  const {earnings, problem} = useEarnings(providerId);
  if (!earnings) return html`<p class="refused">${problem}</p>`;
  const {currency, amount, deliveries, missions, by_day: days} = earnings;
  if (currency === null) return html`<p>No mission is settled yet.</p>`;
  const most = Math.max(...days.map((each) => each.amount), 1);
  return html`
    <p><strong class="sum">${money({amount, currency})}</strong> with ${deliveries}
      ${deliveries === 1 ? " delivery" : " deliveries"} in ${missions} ${missions === 1 ? "mission" : "missions"}.</p>
    <div class="table"><table aria-label="Earnings by day">
      <thead><tr><th>Day (UTC)</th><th>Deliveries</th><th>Missions</th><th>Earned</th>
        <th><span class="unseen">Share of the best day</span></th></tr></thead>
      <tbody>${[...days].reverse().map((each) => html`<${Day} key=${each.day + each.currency} each=${each} most=${most} />`)}</tbody>
    </table></div>
    <${Promises} providerId=${providerId} />`;
}
