// What a delivery costs: the lines of its price, and what the ledger has charged for it.

import {all, part} from "../api.js";
import {html} from "../html.js";
import {useRead} from "../use_read.js";
import {inWords, money, momentText} from "../words.js";

const Lines = ({label, lines, currency}) => html`
  <table class="plain" aria-label=${label}>
    <tbody>
      ${lines.map(({kind, amount, note, at}) => html`
        <tr><th scope="row">${inWords(kind)}${note && html`<br /><small>${note}</small>`}
          ${at && html` <small>${momentText(at)}</small>`}</th>
          <td class="number">${money({amount, currency})}</td></tr>`)}
      <tr class="sum-row"><th scope="row">${label}</th>
        <td class="number">${money({amount: lines.reduce((sum, {amount}) => sum + amount, 0), currency})}</td></tr>
    </tbody>
  </table>`;

// `changed` is anything that changes when more may have been charged.
export function DeliveryPrice({deliveryId, price, changed}) {
  const read = () => all(`/v1/statements/lines?delivery_id=${part(deliveryId)}`);
  const charged = useRead(read, {key: deliveryId, changed}).answer ?? [];
  if (!price && charged.length === 0) return html`<p>The price is known when a plan is found.</p>`;
  const agreed = price && (price.line_items ?? [{kind: "PRICE", amount: price.amount}]);
  return html`
    ${agreed && html`<${Lines} label="Agreed" lines=${agreed} currency=${price.currency} />`}
    ${charged.length > 0
      ? html`<${Lines} label="Charged" lines=${charged} currency=${charged[0].currency} />`
      : html`<p class="hint">Nothing is charged before a mission is over.</p>`}`;
}
