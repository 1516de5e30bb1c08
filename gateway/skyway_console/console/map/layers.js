// The layers of the map, from the ground up: water and land, segments, closures, where the open drone
// could land instead, its plan. Names, stations and drones are drawn on canvases above.

import {colours, isDark} from "./colours.js";
import {collection} from "./geojson.js";

const GROUND = ["land", "lakes", "counties", "rivers", "states", "countries", "people"];
const FLEET = ["segments", "closures", "alternatives", "plan", "draft"];

// What the ground shows is no finer than that: deeper tiles enlarge it.
const GROUND_ZOOM = 11;

const source = (id) => [id, {
  type: "geojson", data: collection([]), ...(GROUND.includes(id) ? {maxzoom: GROUND_ZOOM} : {}),
}];

// The style of the map: an operator's own base map below the fleet, or the ground that comes with it.
// Before the ground is there all is land, because nobody flies over the sea first.
export function mapStyle(ownMap, hasGround) {
  const own = ownMap && (isDark() ? ownMap.dark : ownMap.light);
  return {
    version: 8,
    ...own,
    sources: {...own?.sources, ...Object.fromEntries([...(own ? [] : GROUND), ...FLEET].map(source))},
    layers: [...(own?.layers ?? groundLayers(hasGround)), ...fleetLayers()],
  };
}

export const lineLayer = (id, sourceId, of, more = {}) => ({
  id, type: "line", source: sourceId, paint: of, ...more,
  layout: {"line-cap": "round", "line-join": "round"},
});

const byZoom = (...stops) => ["interpolate", ["exponential", 2], ["zoom"], ...stops];

export const groundColour = (hasGround) => (hasGround ? colours().water : colours().land);

function groundLayers(hasGround) {
  const paint = colours();
  const fill = (id, colour) => ({id, type: "fill", source: id, paint: {"fill-color": colour}});
  return [
    {id: "background", type: "background", paint: {"background-color": groundColour(hasGround)}},
    fill("land", paint.land),
    // Pixels of a kilometre at latitude 30: half of them at each zoom less.
    {id: "people", type: "circle", source: "people", minzoom: 6, paint: {
      "circle-color": paint.urban, "circle-blur": 0.7, "circle-opacity": 0.75,
      "circle-radius": byZoom(6, ["*", ["get", "km"], 0.94], 13, ["*", ["get", "km"], 121]),
    }},
    lineLayer("counties", "counties", {"line-color": paint.state, "line-width": 1, "line-dasharray": [1, 3]},
      {minzoom: 7}),
    lineLayer("states", "states", {"line-color": paint.state, "line-width": 1, "line-dasharray": [3, 2]}),
    lineLayer("rivers", "rivers", {"line-color": paint.river,
      "line-width": ["interpolate", ["linear"], ["zoom"], 3, 0.4, 8, 1, 12, 2.5]}),
    fill("lakes", paint.water),
    lineLayer("countries", "countries", {"line-color": paint.country, "line-width": 1.2}),
  ];
}

// The segments of one station: nothing until somebody points at it or opens it.
export const segmentsOf = (stationId) =>
  ["any", ["==", ["get", "from"], stationId ?? ""], ["==", ["get", "to"], stationId ?? ""]];

function fleetLayers() {
  const paint = colours();
  const isStatus = (status) => ({filter: ["==", ["get", "status"], status]});
  return [
    lineLayer("segments", "segments", {"line-color": paint.segment, "line-width": 1,
      "line-opacity": ["interpolate", ["linear"], ["zoom"], 7, 0.12, 10, 0.3]}),
    lineLayer("segments-near", "segments", {"line-color": paint.planned, "line-width": 1.5,
      "line-opacity": 0.75}, {filter: segmentsOf(null)}),
    {id: "zones", type: "fill", source: "closures",
      paint: {"fill-color": paint.zone, "fill-opacity": 0.18}, filter: ["==", ["geometry-type"], "Polygon"]},
    lineLayer("closed", "closures", {"line-color": paint.zone, "line-width": 2, "line-dasharray": [2, 2]}),
    {id: "draft", type: "fill", source: "draft",
      paint: {"fill-color": paint.selected, "fill-opacity": 0.3}},
    lineLayer("draft-edge", "draft", {"line-color": paint.selected, "line-width": 2}),
    lineLayer("alternatives", "alternatives",
      {"line-color": paint.segment, "line-width": 2, "line-dasharray": [1, 3]}),
    lineLayer("way", "plan", {"line-color": paint.halo, "line-width": 7, "line-opacity": 0.7}),
    lineLayer("flown", "plan", {"line-color": paint.flown, "line-width": 3.5}, isStatus("ENDED")),
    lineLayer("to-come", "plan", {"line-color": paint.planned, "line-width": 3.5, "line-dasharray": [0.2, 1.8]},
      isStatus("PLANNED")),
  ];
}
