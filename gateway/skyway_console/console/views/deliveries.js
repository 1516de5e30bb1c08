// Deliveries: a list with promise against ETA, and one delivery with all that happened to it.

import {useState} from "preact/hooks";

import {firstOf, part} from "../api.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {openView, pathTo} from "../routes.js";
import {DeliveryStateText, stateName, statesOf} from "../state_words.js";
import {useRead} from "../use_read.js";
import {momentText, placeName, shortId} from "../words.js";
import {againstPromise, isLate} from "../parts/delivery_packages.js";
import {DeliveryPage} from "../parts/delivery_page.js";
import {Table} from "../parts/table.js";

// So many deliveries are shown at first, and so many more each time.
const PAGE = 50;

function useDeliveries(state, reference) {
  const path = `/v1/deliveries?${new URLSearchParams({
    ...(state ? {state} : {}), ...(reference ? {reference} : {}),
  })}`;
  const [asked, ask] = useState({path, rows: PAGE});
  const rows = asked.path === path ? asked.rows : PAGE;
  // The list is read again when a delivery comes or goes; the live picture updates the rows.
  const open = Object.keys(picture.deliveries.value).sort().join();
  const {answer, problem} = useRead(() => firstOf(path, rows), {changed: `${path} ${rows} ${open}`});
  return {page: answer ?? {items: [], hasMore: false}, problem, more: () => ask({path, rows: rows + PAGE})};
}

// What can be found in the rows that are read.
const textOf = ({delivery_id: id, reference, customer_id: customer, pickup}) =>
  [id, reference, customer, placeName(pickup)].join(" ").toLowerCase();

function found(items, text) {
  const words = text.toLowerCase().split(" ").filter(Boolean);
  return items.filter((each) => words.every((word) => textOf(each).includes(word)));
}

// A delivery of the list as the live picture shows it now.
function upToDate(delivery) {
  const {state, activity, packages: changed} = picture.deliveries.value[delivery.delivery_id] ?? delivery;
  const packages = delivery.packages.map((each) => ({...each, ...changed[each.package_id]}));
  return {...delivery, state, activity, packages, last: lastOf(packages)};
}

// The package that comes last says how the delivery stands.
const lastOf = (packages) => [...packages].sort((one, other) =>
  (one.delivered_at ?? one.eta_at ?? "").localeCompare(other.delivered_at ?? other.eta_at ?? "")).at(-1);

const recipientOf = ({recipient, packages}) => recipient?.name ?? packages.find((each) => each.recipient)?.recipient.name;

const nameOf = (shown) => shown.reference || recipientOf(shown);

const COLUMNS = [
  ["Delivery", (each) => html`
    <a href=${pathTo("deliveries", each.delivery_id)}>${nameOf(each) || `Delivery ${shortId(each.delivery_id)}`}</a>
    ${nameOf(each) && html`<br /><small>${shortId(each.delivery_id)}</small>`}`, "head"],
  ["Customer", ({customer_id: customer}) => customer],
  ["State", ({state, activity}) => html`
    <span class="state-dot ${state}"></span><${DeliveryStateText} state=${state} activity=${activity} />`],
  ["Way", ({pickup, packages}) => {
    const places = new Set(packages.map(({destination}) => placeName(destination ?? {})));
    return `${placeName(pickup)} → ${[...places].join(", ")}`;
  }],
  ["Packages", ({packages}) => packages.length],
  ["Promised", ({last}) => (last?.due_at ? momentText(last.due_at) : "")],
  ["Expected", ({last}) => {
    const expected = last?.delivered_at ?? last?.eta_at;
    return html`${expected ? momentText(expected) : ""}${last && html`<br /><small>${againstPromise(last)}</small>`}`;
  }, "eta"],
];

function DeliveryList() {
  const [state, setState] = useState("");
  const [reference, setReference] = useState("");
  const [text, setText] = useState("");
  const {page, problem, more} = useDeliveries(state, reference);
  const rows = found(page.items, text);

  function open(event) {
    event.preventDefault();
    const id = new FormData(event.target).get("delivery").trim();
    if (id) openView("deliveries", id);
  }

  return html`
    <div class="page">
      <h1>Deliveries</h1>
      <div class="filters">
        <label>State<select value=${state} onChange=${({target}) => setState(target.value)}>
          <option value="">All</option>
          ${statesOf("delivery").map((each) => html`<option value=${each}>${stateName("delivery", each)}</option>`)}
        </select></label>
        <label>Find below: customer, reference, pickup<input type="search" value=${text}
          onInput=${({target}) => setText(target.value)} /></label>
        <label>Whole reference<input value=${reference} maxlength="200"
          onChange=${({target}) => setReference(target.value)} /></label>
        <form class="row" onSubmit=${open}><label>Id<input name="delivery" placeholder="dlv_…" /></label></form>
      </div>
      ${problem && html`<p class="refused">${problem}</p>`}
      <${Table} label="Deliveries" items=${rows.map(upToDate)} columns=${COLUMNS}
        row=${({delivery_id: id, packages}) => ({key: id, class: packages.some(isLate) ? "late" : ""})}
        empty="No delivery. Requests stand here as soon as somebody makes one." />
      ${text && page.hasMore && html`<p class="hint">${rows.length} of the ${page.items.length} newest
        deliveries. Older ones are searched when they are shown.</p>`}
      ${page.hasMore && html`<button onClick=${more}>Show more</button>`}
    </div>`;
}

export const DeliveriesView = ({parts: [deliveryId]}) =>
  deliveryId
    ? html`<${DeliveryPage} key=${deliveryId} deliveryId=${deliveryId} path=${part(deliveryId)} />`
    : html`<${DeliveryList} />`;
