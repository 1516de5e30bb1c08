// The packages of a delivery: where they go, to whom, and when, against what was promised.

import {html} from "../html.js";
import {StateText} from "../state_words.js";
import {durationText, inWords, momentText, stationName} from "../words.js";
import {BareTable} from "./table.js";

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

const COLUMNS = [
  ["Package", (each) => html`${each.package_id}${each.mass_kg && html` <small>${each.mass_kg} kg</small>`}`, "head"],
  ["To", ({destination, recipient}) => html`${destination?.station_id ? stationName(destination.station_id) : ""}
    <${Recipient} recipient=${recipient} />`],
  ["State", ({state}) => html`<${StateText} kind="package" of=${state} />`],
  ["Promised", ({due_at: due}) => orNothing(due)],
  ["Expected", (each) => html`${each.delivered_at
    ? `handed over ${momentText(each.delivered_at)}` : orNothing(each.eta_at)}
    <br /><small>${againstPromise(each)}</small>`, "eta"],
];

// `recipient` takes the packages that have none of their own.
export function DeliveryPackages({packages, recipient}) {
  const hasReasons = packages.some(reasonOf);
  return html`
    <${BareTable} label="Packages" items=${packages.map((each) => ({...each, recipient: each.recipient ?? recipient}))}
      columns=${hasReasons ? [...COLUMNS, ["Why", reasonOf]] : COLUMNS}
      row=${(each) => ({key: each.package_id, class: isLate(each) ? "late" : ""})} />`;
}
