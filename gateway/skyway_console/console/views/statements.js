// Statements of a month: what customers pay and providers get, and the lines that they sum up.

import {signal} from "@preact/signals";

import {get, part, saveCsv} from "../api.js";
import {WORDS} from "../desk_words.js";
import {fleetNow} from "../fleet_clock.js";
import {html} from "../html.js";
import {pathTo} from "../routes.js";
import {session} from "../session.js";
import {useRead} from "../use_read.js";
import {dayText, inWords, money, momentText, shortId} from "../words.js";
import {Earned} from "../parts/earned.js";
import {attempt} from "../parts/messages.js";
import {Table} from "../parts/table.js";

const TEXTS = WORDS.statements;
const PATH = "/v1/statements";

// It outlives the view. Empty: the present month.
const chosenMonth = signal("");

async function readMonth(month) {
  const read = (path) => get(`${path}?month=${part(month)}&limit=200`);
  const [statements, lines] = await Promise.all([read(PATH), read(`${PATH}/lines`)]);
  return {statements, lines};
}

function Statement({of: {role, party_id: party, currency, amount, items, deliveries, lines, closed_at: closedAt}}) {
  const title = (role === "customer" ? TEXTS.pays : TEXTS.gets)(party);
  const shown = Object.entries(items).filter(([, each]) => each !== 0);
  return html`
    <section class="card" aria-label=${title}>
      <h2>${title} <span class="sum">${money({amount, currency})}</span></h2>
      <table aria-label=${`Items: ${title}`}><tbody>
        ${shown.map(([kind, each]) => html`
          <tr><th scope="row">${inWords(kind)}</th><td class="number">${money({amount: each, currency})}</td></tr>`)}
      </tbody></table>
      <p class="hint">${TEXTS.counted(deliveries, lines)} ${closedAt ? TEXTS.closed(dayText(closedAt)) : TEXTS.open}</p>
    </section>`;
}

const deliveryOf = (id) => (session.value.role === "provider"
  ? shortId(id) : html`<a href=${pathTo("deliveries", id)}>${shortId(id)}</a>`);

const LINE_COLUMNS = [
  ["Written", ({at}) => momentText(at), "title"],
  ["Delivery", ({delivery_id: id}) => deliveryOf(id)],
  ["Mission", ({mission_id: id}) => shortId(id)],
  ["Kind", ({kind}) => inWords(kind)],
  ["Amount", money, "number"],
  ["Why", ({note}) => note],
];

const Lines = ({of: {items, next_cursor: more}}) => html`
  <h2>${TEXTS.lines}</h2>
  <${Table} label=${TEXTS.lines} items=${items} columns=${LINE_COLUMNS}
    row=${(line) => ({key: line.mission_id + line.number})} />
  ${more && html`<p>${TEXTS.more}</p>`}`;

const Month = ({month, found}) => html`
  <div class="commands">
    <button onClick=${() => attempt(() => saveCsv(`${PATH}?month=${part(month)}&limit=200`, `statements-${month}.csv`))}>
      ${TEXTS.csv}</button>
    <button onClick=${() => attempt(() => saveCsv(`${PATH}/lines?month=${part(month)}&limit=200`, `lines-${month}.csv`))}>
      ${TEXTS.linesCsv}</button>
    <a href=${`${PATH}?month=${part(month)}&limit=200`} target="_blank" rel="noopener">${TEXTS.print}</a>
  </div>
  <div class="statements">${found.statements.items.map((each) => html`
    <${Statement} key=${each.role + each.party_id + each.currency} of=${each} />`)}</div>
  ${session.value.role !== "customer" && html`<${Earned} key=${month} month=${month} />`}
  ${found.lines.items.length > 0 && html`<${Lines} of=${found.lines} />`}`;

export function StatementsView() {
  const month = chosenMonth.value || new Date(fleetNow()).toISOString().slice(0, 7);
  const {answer: found, problem} = useRead(() => readMonth(month), {key: month});
  return html`
    <div class="page">
      <h1>Statements</h1>
      <div class="fields"><label>${TEXTS.month}<input type="month" value=${month}
        onChange=${({target}) => (chosenMonth.value = target.value)} /></label></div>
      ${problem && html`<p class="refused" role="alert">${problem}</p>`}
      ${found?.statements.items.length === 0 && html`<p>${TEXTS.none}</p>`}
      ${found?.statements.items.length > 0 && html`<${Month} month=${month} found=${found} />`}
    </div>`;
}
