// Finds a drone or a station by its name and opens it: the keyboard's way to what the map shows.

import {useEffect, useRef, useState} from "preact/hooks";

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
  // On a phone the box is a button until somebody looks for something.
  const [isOpen, setOpen] = useState(false);
  const input = useRef(null);
  useEffect(() => {
    if (isOpen) input.current.focus();
  }, [isOpen]);
  // What nobody looks for is not searched: there may be thousands of drones.
  const matches = text ? found([...stationPlaces(network), ...dronePlaces()], text) : [];
  const leave = () => {
    setText("");
    setOpen(false);
  };
  const open = (event) => {
    event.preventDefault();
    if (matches.length === 0) return;
    location.hash = pathTo(...matches[0].href);
    leave();
  };
  return html`
    <button class="search-button" aria-label="Search" aria-expanded=${isOpen}
      onClick=${() => setOpen(!isOpen)}>
      <svg viewBox="0 0 20 20" aria-hidden="true">
        <path d="M13 13l4.5 4.5M14.5 9a5.5 5.5 0 1 1-11 0 5.5 5.5 0 0 1 11 0z" />
      </svg>
    </button>
    <search class="map-search ${isOpen ? "open" : ""}">
      <form onSubmit=${open}>
        <input type="search" ref=${input} aria-label="Find a drone or a station"
          placeholder="Find a drone or a station"
          value=${text} onInput=${({target}) => setText(target.value)} />
      </form>
      ${text && html`
        <ul aria-label="Found">
          ${matches.slice(0, MOST).map(({name, id, href}) => html`
            <li key=${id}><a href=${pathTo(...href)} onClick=${leave}>${name}</a></li>`)}
          ${matches.length > MOST && html`<li>and ${matches.length - MOST} more</li>`}
          ${matches.length === 0 && html`<li>Nothing has this name.</li>`}
        </ul>`}
    </search>`;
}
