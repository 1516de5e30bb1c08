// Draws the way of one delivery on a map: what was flown, what is to come, and its stops with their names.

import {Marker} from "maplibre-gl";

import {inWords, stationName} from "../words.js";
import {colours} from "./colours.js";
import {lineLayer} from "./layers.js";
import {cornersOf, drawAround, near} from "./longitudes.js";
import {overlay} from "./overlay.js";

const PADDING = {top: 56, bottom: 36, left: 72, right: 72};
const FARTHEST_ZOOM = 13;

function layers() {
  const paint = colours();
  const line = (kind, of) => lineLayer(`way-${kind}`, "way", of, {filter: ["==", ["get", "kind"], kind]});
  return [
    line("PLANNED", {"line-color": paint.planned, "line-width": 3, "line-dasharray": [1, 2]}),
    line("FLOWN", {"line-color": paint.planned, "line-width": 4}),
  ];
}

// What happens at a stop, by its most important step.
function roleOf({is_pickup: isPickup, stops}) {
  if (isPickup) return "pickup";
  return stops.some(({kind}) => kind === "DELIVER") ? "destination" : "stop";
}

function stopMarker({geometry, properties}) {
  const {station_id: id, stops} = properties;
  const role = roleOf(properties);
  const element = document.createElement("div");
  const isDone = stops.length > 0 && stops.every(({status}) => status === "ENDED");
  element.className = `way-stop ${role}${isDone ? " done" : ""}`;
  const name = document.createElement("span");
  name.textContent = stationName(id);
  element.append(name);
  element.title = `${stationName(id)}: ${stops.map(({kind}) => inWords(kind).toLowerCase()).join(", ")}`;
  return new Marker({element, anchor: "bottom", offset: [0, 7]}).setLngLat(near(geometry.coordinates));
}

export class WayLayer {
  constructor({map, stations}) {
    this.map = map;
    this.stations = stations;
    this.draw = overlay(map, "way", layers);
    this.markers = [];
    this.bounds = "";
  }

  // `track` is the track of a delivery, as the API has it.
  show({features}) {
    const first = features.find(({geometry}) => geometry.type === "Point");
    if (!first) return;
    drawAround(first.geometry.coordinates[0]);
    this.draw(features.filter(({geometry}) => geometry.type === "LineString"));
    this.markers.forEach((each) => each.remove());
    this.markers = features.filter(({properties}) => properties.kind === "STATION").map(stopMarker);
    this.markers.forEach((each) => each.addTo(this.map));
    this.fit(features);
    this.stations.keepMarkersFree(this.markers);
  }

  // The whole way is in the picture. It moves only when the way becomes another one.
  fit(features) {
    const bounds = cornersOf(features.flatMap(({geometry: {type, coordinates}}) =>
      (type === "Point" ? [coordinates] : coordinates)).map(near));
    if (this.bounds === String(bounds)) return;
    this.bounds = String(bounds);
    this.map.fitBounds(bounds, {padding: PADDING, maxZoom: FARTHEST_ZOOM, duration: 0});
  }
}
