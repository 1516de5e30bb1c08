// Marks a request on the map: its pickup, its destinations, and the ways of its offers. Without
// offers straight lines show what is meant.

import {Marker} from "maplibre-gl";

import {colourInBothThemes} from "./colours.js";
import {placesOf} from "./features.js";
import {collection, line} from "./geojson.js";

function mark(text, colour) {
  const element = document.createElement("span");
  element.className = "request-mark";
  element.textContent = text;
  element.style.background = colourInBothThemes(colour);
  return new Marker({element, anchor: "top", offset: [0, 9]});
}

export class RequestMarks {
  constructor(fleetMap) {
    this.fleetMap = fleetMap;
    this.marks = [];
  }

  show(network, {pickup, pickupPlace, packages}, offered) {
    const places = placesOf(network);
    const destinations = packages.filter(({station_id}) => places[station_id]);
    this.marks.forEach((each) => each.remove());
    this.marks = [
      ...(places[pickup] ? [mark("Pickup", "selected").setLngLat(pickupPlace?.position ?? places[pickup])] : []),
      ...destinations.map(({package_id, station_id, place}) =>
        mark(package_id, "drone").setLngLat(place?.position ?? places[station_id])),
    ];
    this.marks.forEach((each) => each.addTo(this.fleetMap.map));
    const straight = destinations.map(({station_id}) => ({isChosen: false, ways: [[pickup, station_id]]}));
    this.fleetMap.put("plan", collection(wayLines(places, offered.length ? offered : straight)));
  }
}

// The chosen offer is drawn like what was flown, the others like what is planned.
const wayLines = (places, offered) => offered.flatMap(({ways, isChosen}) => ways
  .filter((way) => way.length > 1 && way.every((stationId) => places[stationId]))
  .map((way) => line(way.map((stationId) => places[stationId]), {status: isChosen ? "ENDED" : "PLANNED"})));
