// Deliveries: a list with promise against ETA, and one delivery with all that happened to it.

import {useEffect, useState} from "preact/hooks";

import {get, part} from "../api.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {openView, pathTo} from "../routes.js";
import {inWords, momentText, shortId, stationName} from "../words.js";
import {DeliveryPage, isLate} from "../parts/delivery_page.js";

const STATES = ["SCHEDULED", "REQUESTED", "PLANNED", "DISPATCHED", "LOADING", "IN_PROGRESS", "COMPLETED",
  "PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED"];

function useDeliveries(state, reference) {
  const [page, setPage] = useState({items: [], next_cursor: null});
  const [problem, setProblem] = useState("");
  const filters = new URLSearchParams({limit: "50"});
  if (state) filters.set("state", state);
  if (reference) filters.set("reference", reference);
  const path = `/v1/deliveries?${filters}`;
  // The list is read again when a delivery comes or goes; the live picture updates the rows.
  const open = Object.keys(picture.deliveries.value).length;
  useEffect(() => {
    get(path).then((read) => (setPage(read), setProblem("")), (refusal) => setProblem(refusal.message));
  }, [path, open]);
  async function more() {
    const next = await get(`${path}&cursor=${encodeURIComponent(page.next_cursor)}`);
    setPage({items: [...page.items, ...next.items], next_cursor: next.next_cursor});
  }
  return {page, problem, more};
}

// A delivery of the list as the live picture shows it now.
function upToDate(delivery) {
  const live = picture.deliveries.value[delivery.delivery_id];
  if (!live) return delivery;
  const packages = delivery.packages.map((each) => ({...each, ...live.packages[each.package_id]}));
  return {...delivery, state: live.state, activity: live.activity, packages};
}

const latest = (packages, name) =>
  packages.map((each) => each[name]).filter(Boolean).sort().at(-1);

function Row({delivery}) {
  const {delivery_id, reference, customer_id, state, activity, request, packages} = upToDate(delivery);
  const [promised, eta] = [latest(packages, "promised_at"), latest(packages, "eta_at")];
  return html`
    <tr class=${packages.some(isLate) ? "late" : ""}>
      <td><a href=${pathTo("deliveries", delivery_id)}>${shortId(delivery_id)}</a></td>
      <td>${reference}</td>
      <td>${customer_id}</td>
      <td>${inWords(state)}${activity ? `, ${inWords(activity).toLowerCase()}` : ""}</td>
      <td>${placeName(request.pickup)}</td>
      <td>${packages.length}</td>
      <td>${promised ? momentText(promised) : ""}</td>
      <td class="eta">${eta ? momentText(eta) : ""}</td>
    </tr>`;
}

const placeName = (place) => (place.station_id ? stationName(place.station_id) : "a place on the map");

function DeliveryList() {
  const [state, setState] = useState("");
  const [reference, setReference] = useState("");
  const {page, problem, more} = useDeliveries(state, reference);

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
          ${STATES.map((each) => html`<option value=${each}>${inWords(each)}</option>`)}
        </select></label>
        <label>Reference<input value=${reference} maxlength="200"
          onChange=${({target}) => setReference(target.value)} /></label>
        <form class="row" onSubmit=${open}><label>Id<input name="delivery" placeholder="dlv_…" /></label></form>
      </div>
      ${problem && html`<p class="refused">${problem}</p>`}
      <div class="table"><table aria-label="Deliveries">
        <thead><tr><th>Id</th><th>Reference</th><th>Customer</th><th>State</th><th>Pickup</th>
          <th>Packages</th><th>Promised</th><th>Expected</th></tr></thead>
        <tbody>
          ${page.items.map((delivery) => html`<${Row} key=${delivery.delivery_id} delivery=${delivery} />`)}
          ${page.items.length === 0 && html`<tr><td colspan="8">No delivery.</td></tr>`}
        </tbody>
      </table></div>
      ${page.next_cursor && html`<button onClick=${more}>Show more</button>`}
    </div>`;
}

export const DeliveriesView = ({parts: [deliveryId]}) =>
  deliveryId
    ? html`<${DeliveryPage} key=${deliveryId} deliveryId=${deliveryId} path=${part(deliveryId)} />`
    : html`<${DeliveryList} />`;
