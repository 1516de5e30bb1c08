// What a customer asks for while it is being put together: pickup, packages and wishes.

import {signal} from "@preact/signals";

import {post} from "../api.js";
import {openView} from "../routes.js";

export const OBJECTIVES = ["FASTEST", "CHEAPEST", "GREENEST"];
export const MOST_PACKAGES = 100;

const newPackage = (number) => ({package_id: `p${number}`, mass_kg: "1", station_id: "", place: null, proof: ""});
const nobody = () => ({name: "", phone: "", email: "", instructions: ""});
// A place is {label, position, station} of what is no station; its station stands beside it.
const nothing = () => ({pickup: "", pickupPlace: null, walkM: "1000", contact: nobody(), packages: [newPackage(1)], objective: "FASTEST", reference: "",
  latest: "", isHeld: false, mayShare: false, waitMinutes: "0", withinM: "0", firmMinutes: "0", laterMinutes: "0",
  mayChange: false});

// It outlives the view, so that a look at another view loses nothing.
export const draft = signal(nothing());

// What the map draws of the offers: {ways, isChosen} each; the chosen one is pointed at in the table.
export const offeredWays = signal([]);

export const change = (members) => (draft.value = {...draft.value, ...members});
export const beginAgain = () => (draft.value = nothing());

export function changePackage(number, members) {
  change({packages: draft.value.packages.map((each, n) => (n === number ? {...each, ...members} : each))});
}

function unusedPackage(packages) {
  const used = new Set(packages.map(({package_id}) => package_id));
  let number = packages.length + 1;
  while (used.has(`p${number}`)) number += 1;
  return newPackage(number);
}

export function addPackage(stationId = "", place = null) {
  const {packages} = draft.value;
  if (packages.length >= MOST_PACKAGES) return;
  change({packages: [...packages, {...unusedPackage(packages), station_id: stationId, place}]});
}

export const removePackage = (number) =>
  change({packages: draft.value.packages.filter((_, n) => n !== number)});

// A pickup that nobody chose: where the last delivery began.
export const suggestPickup = (stationId) => draft.value.pickup === "" && change({pickup: stationId});

// The pickup first, then one destination after the other.
export function choose(stationId, place = null, {isDestination = false} = {}) {
  const {pickup, packages} = draft.value;
  const open = packages.findIndex(({station_id}) => station_id === "");
  if (pickup === "" && !isDestination) change({pickup: stationId, pickupPlace: place});
  else if (open >= 0) changePackage(open, {station_id: stationId, place});
  else addPackage(stationId, place);
}

// A place is sent as its point: quotes compare the stations near it.
function placeOf(stationId, place, walkM) {
  if (!place) return {station_id: stationId};
  const [longitude, latitude] = place.position;
  return {location: {latitude, longitude}, max_walk_m: Number(walkM)};
}

// The body of POST /v1/quotes. The browser's own time zone is that of all moments in the console.
export function quoteRequest() {
  const {pickup, pickupPlace, walkM, packages, objective, reference, latest, isHeld, mayShare, waitMinutes, withinM,
    firmMinutes, laterMinutes, mayChange} = draft.value;
  const pooling = mayShare
    ? {pooling: true, pooling_wait_s: 60 * Number(waitMinutes), pickup_within_m: Number(withinM)} : {};
  const promise = {firm_within_s: 60 * Number(firmMinutes), may_be_later_s: 60 * Number(laterMinutes),
    may_change_provider: mayChange};
  return {
    pickup: placeOf(pickup, pickupPlace, walkM),
    packages: packages.map(({package_id, mass_kg, station_id, place, proof}) =>
      ({package_id: package_id.trim(), mass_kg: Number(mass_kg), destination: placeOf(station_id, place, walkM),
        ...(proof ? {dropoff_verification: {method: proof}} : {})})),
    qos: {objective, ...promise, ...pooling, ...(latest ? {deadline_at: new Date(latest).toISOString()} : {})},
    ...(reference.trim() ? {reference: reference.trim()} : {}),
    hold: isHeld,
  };
}

// The members of POST /v1/deliveries that name people; quotes take none of them.
function people() {
  const {instructions, ...contact} = draft.value.contact;
  const recipient = Object.fromEntries(Object.entries(contact)
    .map(([name, text]) => [name, text.trim()]).filter(([, text]) => text));
  return {
    ...(Object.keys(recipient).length ? {recipient} : {}),
    ...(instructions.trim() ? {instructions: instructions.trim()} : {}),
  };
}

// Requests what `asked` says, with the people of the draft, and opens the delivery.
export async function requestDelivery(asked, headers) {
  const {delivery_id: deliveryId} = await post("/v1/deliveries", {...asked, ...people()}, headers);
  beginAgain();
  openView("deliveries", deliveryId);
}
