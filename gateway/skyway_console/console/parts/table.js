// A table whose rows are cards on a phone.

import {html} from "../html.js";

// Cells that need no label on a card: its title, what is as wide as the card, and commands.
const NO_LABEL = /title|wide-cell|act/;

function Cell({name, kind = "", children}) {
  if (kind === "head") return html`<th scope="row">${children}</th>`;
  const label = NO_LABEL.test(kind) || typeof name !== "string" ? undefined : name;
  return html`<td class=${kind} data-label=${label}>${children}</td>`;
}

// Columns are [name, cell, kind]: `cell` answers what stands there for an item, `kind` is its classes, or "head". `row` answers the
// attributes of an item's row, and `empty` is what stands in a table without items.
export const BareTable = ({label, columns, items, row = () => ({}), empty}) => html`
  <table class="as-cards" aria-label=${label}>
    <thead><tr>${columns.map(([name]) => html`<th>${name}</th>`)}</tr></thead>
    <tbody>
      ${items.map((item) => html`
        <tr ...${row(item)}>${columns.map(([name, cell, kind]) => html`<${Cell} name=${name} kind=${kind}>${cell(item)}</${Cell}>`)}</tr>`)}
      ${empty && items.length === 0 && html`<tr><td colspan=${columns.length}>${empty}</td></tr>`}
    </tbody>
  </table>`;

// One with a frame, which scrolls where it is wider than the page. `feeds` is a class of what feeds it.
export const Table = ({feeds = "", ...of}) => html`<div class="table ${feeds}"><${BareTable} ...${of} /></div>`;

// The name of a column that only screen readers need.
export const unseen = (name) => html`<span class="unseen">${name}</span>`;
