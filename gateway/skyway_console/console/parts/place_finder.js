// Finds places that are no stations, with the station that serves each; a place may be chosen then.

import {signal} from "@preact/signals";

import {get} from "../api.js";
import {WORDS} from "../desk_words.js";
import {html} from "../html.js";
import {stationsOf} from "../map/features.js";
import {stationName} from "../words.js";
import {attempt, say} from "./messages.js";
import {change, choose, draft} from "./request_draft.js";

const MOST_WALK_M = 5_000;
const COORDINATES = /^\s*(-?\d+\.?\d*)\s*,\s*(-?\d+\.?\d*)\s*$/;
const PLUS_CODE = /^[2-9A-Za-z]{4,8}\+/;
const WORDS_HERE = WORDS.places;

const text = signal("");
// The candidates of the last search, or null before the first one.
const found = signal(null);

export const walkText = ({station_id: stationId, walk_m: metres}) =>
  WORDS_HERE.served(stationName(stationId), Math.round(metres));

// By the form of the text, as `skyway quote` reads it.
function queryOf(typed) {
  const [, latitude, longitude] = COORDINATES.exec(typed) ?? [];
  if (latitude) return {latitude, longitude};
  return PLUS_CODE.test(typed.trim()) ? {plus_code: typed.trim()} : {address: typed.trim()};
}

// The places that a query may mean, each with its nearest station in this network.
async function placesOf(query, network) {
  const known = new Set(stationsOf(network).map(({properties}) => properties.station_id));
  const asked = new URLSearchParams({...query, max_walk_m: draft.value.walkM});
  const {candidates} = await get(`/v1/places?${asked}`);
  return candidates.flatMap(({label, position, stations}) => {
    const station = stations.find(({station_id: stationId}) => known.has(stationId));
    return station ? [{label, position, station}] : [];
  });
}

// A click beside the stations of the map: the point is the pickup, or the next destination.
export const choosePoint = ([longitude, latitude], network) => attempt(async () => {
  const [place] = await placesOf({latitude: latitude.toFixed(6), longitude: longitude.toFixed(6)}, network);
  if (place) choose(place.station.station_id, {...place, label: WORDS_HERE.point});
  else say(WORDS_HERE.nothing, "refused");
});

function pick(place, isPickup) {
  found.value = null;
  text.value = "";
  if (isPickup) change({pickup: place.station.station_id, pickupPlace: place});
  else choose(place.station.station_id, place, {isDestination: true});
}

// The stations whose names hold what is typed; so many are offered.
const MOST_STATIONS = 4;

function stationsLike(typed, network) {
  const searched = typed.trim().toLowerCase();
  if (searched.length < 2) return [];
  return stationsOf(network).map(({properties}) => properties.station_id)
    .filter((id) => stationName(id).toLowerCase().includes(searched)).slice(0, MOST_STATIONS);
}

function deliverTo(stationId) {
  found.value = null;
  text.value = "";
  choose(stationId, null, {isDestination: true});
}

const Candidate = ({place}) => html`
  <li><strong>${place.label}</strong><br /><small>${walkText(place.station)}</small>
    <div class="commands">
      <button type="button" class="main" onClick=${() => pick(place, false)}>${WORDS_HERE.deliver}</button>
      <button type="button" onClick=${() => pick(place, true)}>${WORDS_HERE.pickUp}</button>
    </div></li>`;

export function PlaceFinder({network}) {
  const stations = stationsLike(text.value, network);
  const find = (event) => {
    event.preventDefault();
    if (stations.length === 1) deliverTo(stations[0]);
    else attempt(async () => (found.value = await placesOf(queryOf(text.value), network)));
  };
  return html`
    <form class="fields finder" aria-label=${WORDS_HERE.title} onSubmit=${find}>
      <label>${WORDS_HERE.query}<input type="search" required minlength="2" maxlength="300" value=${text.value}
        placeholder=${WORDS_HERE.example} onInput=${({target}) => (text.value = target.value)} /></label>
      <button>${WORDS_HERE.find}</button>
    </form>
    <div aria-live="polite">
      ${stations.length > 0 && html`<ul class="found stations" aria-label=${WORDS_HERE.stations}>
        ${stations.map((id) => html`<li key=${id}><button type="button" onClick=${() => deliverTo(id)}>
          ${WORDS_HERE.deliverTo(stationName(id))}</button></li>`)}
      </ul>`}
      ${found.value?.length === 0 && html`<p class="hint">${WORDS_HERE.nothing}</p>`}
      ${found.value?.length > 0 && html`<ul class="found" aria-label="Places">
        ${found.value.map((place) => html`<${Candidate} key=${place.label + place.position} place=${place} />`)}
      </ul>`}
    </div>`;
}

export const WalkLimit = () => html`
  <label>${WORDS_HERE.walk}<input required type="number" min="1" max=${MOST_WALK_M} step="any"
    value=${draft.value.walkM} onInput=${({target}) => change({walkM: target.value})} /></label>`;

export const ChosenPlace = ({place}) => place && html`
  <small class="chosen-place">${WORDS_HERE.chosen(place.label, walkText(place.station))}</small>`;
