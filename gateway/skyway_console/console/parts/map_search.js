// Finds a drone or a station by its name and opens it: the keyboard's way to what the map shows.

import {useState} from "preact/hooks";

import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {stationsOf} from "../map/features.js";
import {pathTo} from "../routes.js";
import {stationName} from "../words.js";

const MOST = 8;

const stationPlaces = (network) => (network ? stationsOf(network) : []).map(({properties}) => ({
  name: properties.name ?? stationName(properties.station_id), id: properties.station_id,
  href: ["map", "station", properties.station_id],
}));

const dronePlaces = () => Object.entries(picture.drones.value).map(([id, {name}]) => ({
  name: droneName(id, name), id, href: ["map", "drone", id],
}));

function found(places, text) {
  const wanted = text.trim().toLowerCase();
  if (!wanted) return [];
  return places.filter(({name, id}) => `${name} ${id}`.toLowerCase().includes(wanted));
}

export function MapSearch({network}) {
  const [text, setText] = useState("");
  // What nobody looks for is not searched: there may be thousands of drones.
  const matches = text ? found([...stationPlaces(network), ...dronePlaces()], text) : [];
  const open = (event) => {
    event.preventDefault();
    if (matches.length) location.hash = pathTo(...matches[0].href);
  };
  return html`
    <search class="map-search">
      <form onSubmit=${open}>
        <input type="search" aria-label="Find a drone or a station" placeholder="Find a drone or a station"
          value=${text} onInput=${({target}) => setText(target.value)} />
      </form>
      ${text && html`
        <ul aria-label="Found">
          ${matches.slice(0, MOST).map(({name, id, href}) => html`
            <li key=${id}><a href=${pathTo(...href)} onClick=${() => setText("")}>${name}</a></li>`)}
          ${matches.length > MOST && html`<li>and ${matches.length - MOST} more</li>`}
          ${matches.length === 0 && html`<li>Nothing has this name.</li>`}
        </ul>`}
    </search>`;
}
