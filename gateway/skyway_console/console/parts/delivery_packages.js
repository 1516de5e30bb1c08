// The packages of a delivery: where they go, to whom, and when, against what was promised.

import {html} from "../html.js";
import {StateText} from "../state_words.js";
import {durationText, inWords, momentText, stationName} from "../words.js";

const LATE_MS = 60_000;

export const isLate = ({due_at: promised, eta_at: eta, delivered_at: delivered}) =>
  promised && (delivered ?? eta) && Date.parse(delivered ?? eta) - Date.parse(promised) > LATE_MS;

// "as promised", "6 min later than promised".
export function againstPromise({due_at: promised, eta_at: eta, delivered_at: delivered}) {
  if (!promised || !(delivered ?? eta)) return "";
  const ms = Date.parse(delivered ?? eta) - Date.parse(promised);
  if (Math.abs(ms) <= LATE_MS) return "as promised";
  return `${durationText(ms / 1_000)} ${ms > 0 ? "later" : "earlier"} than promised`;
}

const orNothing = (moment) => (moment ? momentText(moment) : "");

const Recipient = ({recipient}) => recipient && html`
  <br /><small>for ${[recipient.name, recipient.phone ?? recipient.email].filter(Boolean).join(", ")}</small>`;

const reasonOf = ({code, detail}) => [code && inWords(code), detail].filter(Boolean).join(" ");

const Package = ({each, recipient, hasReasons}) => html`
  <tr class=${isLate(each) ? "late" : ""}>
    <th scope="row">${each.package_id}${each.mass_kg && html` <small>${each.mass_kg} kg</small>`}</th>
    <td data-label="To">${each.destination?.station_id ? stationName(each.destination.station_id) : ""}
      <${Recipient} recipient=${each.recipient ?? recipient} /></td>
    <td data-label="State"><${StateText} kind="package" of=${each.state} /></td>
    <td data-label="Promised">${orNothing(each.due_at)}</td>
    <td data-label="Expected" class="eta">${each.delivered_at
      ? `handed over ${momentText(each.delivered_at)}` : orNothing(each.eta_at)}
      <br /><small>${againstPromise(each)}</small></td>
    ${hasReasons && html`<td data-label="Why">${reasonOf(each)}</td>`}
  </tr>`;

// `recipient` takes the packages that have none of their own.
export function DeliveryPackages({packages, recipient}) {
  const hasReasons = packages.some(reasonOf);
  return html`
    <table class="as-cards" aria-label="Packages">
      <thead><tr><th>Package</th><th>To</th><th>State</th><th>Promised</th><th>Expected</th>
        ${hasReasons && html`<th>Why</th>`}</tr></thead>
      <tbody>
        ${packages.map((each) => html`
          <${Package} key=${each.package_id} each=${each} recipient=${recipient} hasReasons=${hasReasons} />`)}
      </tbody>
    </table>`;
}
