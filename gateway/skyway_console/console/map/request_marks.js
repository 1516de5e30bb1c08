// Marks a request on the map: its pickup, its destinations, and straight lines between them.

import {Marker} from "maplibre-gl";

import {colours} from "./colours.js";
import {stationsOf} from "./features.js";

function mark(text, colour) {
  const element = document.createElement("span");
  element.className = "request-mark";
  element.textContent = text;
  element.style.background = colour;
  return new Marker({element, anchor: "top", offset: [0, 9]});
}

export class RequestMarks {
  constructor(fleetMap) {
    this.fleetMap = fleetMap;
    this.marks = [];
  }

  show(network, {pickup, packages}) {
    const places = Object.fromEntries(stationsOf(network)
      .map(({geometry, properties}) => [properties.station_id, geometry.coordinates]));
    const destinations = packages.filter(({station_id}) => places[station_id]);
    this.marks.forEach((each) => each.remove());
    const paint = colours();
    this.marks = [
      ...(places[pickup] ? [mark("Pickup", paint.selected).setLngLat(places[pickup])] : []),
      ...destinations.map(({package_id, station_id}) =>
        mark(package_id, paint.drone).setLngLat(places[station_id])),
    ];
    this.marks.forEach((each) => each.addTo(this.fleetMap.map));
    const lines = places[pickup] ? destinations.map(({station_id}) => ({
      type: "Feature", properties: {status: "PLANNED"},
      geometry: {type: "LineString", coordinates: [places[pickup], places[station_id]]},
    })) : [];
    this.fleetMap.put("plan", {type: "FeatureCollection", features: lines});
  }
}
