// The base map that comes with Skyway and needs no network: land, water, borders and places.
// tools/make_base_map.py writes ground.json and names the sources.

import {collection, feature} from "./geojson.js";

// What the licences ask a map to say.
export const SOURCES_TEXT =
  "Natural Earth · US Census · GSHHG (LGPL) · © OpenStreetMap (ODbL) · GeoNames (CC BY 4.0)";

// Kilometres of land around a place for each person of a city, as a tint: people, not an outline.
const KM_OF = (people) => Math.sqrt(people / 5_000);

// A line that is written as its first point and the steps to the next ones, on a grid.
function unpacked(steps, gridDeg) {
  const line = [];
  let [x, y] = [0, 0];
  for (let at = 0; at < steps.length; at += 2) {
    [x, y] = [x + steps[at], y + steps[at + 1]];
    line.push([x * gridDeg, y * gridDeg]);
  }
  return line;
}

// By the name of their source: what the map draws below the fleet.
function groundFeatures(content) {
  const lines = (name) => content[name].map((steps) => unpacked(steps, content.grid_deg));
  const areas = (name) => collection(lines(name).map((ring) => feature("Polygon", [ring])));
  const multiLine = (name) => collection([feature("MultiLineString", lines(name))]);
  return {
    land: areas("land"), lakes: areas("lakes"),
    counties: multiLine("counties"), rivers: multiLine("rivers"),
    states: multiLine("states"), countries: multiLine("countries"),
    people: collection(content.places.map(([, longitude, latitude, people]) =>
      feature("Point", [longitude, latitude], {km: KM_OF(people)}))),
  };
}

// From rows of [name, longitude, latitude, people], the largest place first.
export const placesOf = (rows) => rows.map(([name, longitude, latitude, people]) =>
  ({name, position: [longitude, latitude], people}));

// The data of the sources, and the named places.
export async function readGround() {
  const content = await (await fetch("/console/map/ground.json")).json();
  return {features: groundFeatures(content), places: placesOf(content.places)};
}
