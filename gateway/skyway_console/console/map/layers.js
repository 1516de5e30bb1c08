// The layers of the map, from the ground up: outlines, segments, closures, where the open drone
// could land instead, its plan, stations.

import {colours} from "./colours.js";

export const NOTHING = {type: "FeatureCollection", features: []};

export const SOURCES = ["countries", "counties", "segments", "closures", "alternatives", "plan", "draft",
  "stations"];

const source = (id) => [id, {type: "geojson", data: NOTHING}];

// The style of the map: an operator's own base map below the fleet, or a plain ground.
export function mapStyle(own) {
  const ground = {id: "background", type: "background", paint: {"background-color": colours().background}};
  return {
    version: 8,
    ...own,
    sources: {...own?.sources, ...Object.fromEntries(SOURCES.map(source))},
    layers: [...(own?.layers ?? [ground]), ...fleetLayers()],
  };
}

function fleetLayers() {
  const paint = colours();
  const line = (id, sourceId, of, filter) => ({
    id, type: "line", source: sourceId, paint: of, ...(filter ? {filter} : {}),
    layout: {"line-cap": "round", "line-join": "round"},
  });
  const isStatus = (status) => ["==", ["get", "status"], status];
  return [
    line("counties", "counties", {"line-color": paint.county, "line-width": 1}),
    line("countries", "countries", {"line-color": paint.country, "line-width": 1}),
    line("segments", "segments", {"line-color": paint.segment, "line-width": 1}),
    {id: "zones", type: "fill", source: "closures",
      paint: {"fill-color": paint.zone, "fill-opacity": 0.22}, filter: ["==", ["geometry-type"], "Polygon"]},
    line("closed", "closures", {"line-color": paint.zone, "line-width": 2, "line-dasharray": [2, 2]}),
    {id: "draft", type: "fill", source: "draft",
      paint: {"fill-color": paint.selected, "fill-opacity": 0.3}},
    line("draft-edge", "draft", {"line-color": paint.selected, "line-width": 2}),
    line("alternatives", "alternatives",
      {"line-color": paint.segment, "line-width": 2, "line-dasharray": [1, 3]}),
    line("to-come", "plan", {"line-color": paint.planned, "line-width": 3, "line-dasharray": [1, 2]},
      isStatus("PLANNED")),
    line("flown", "plan", {"line-color": paint.flown, "line-width": 4}, isStatus("ENDED")),
    {id: "stations", type: "circle", source: "stations", paint: {
      "circle-radius": ["interpolate", ["linear"], ["zoom"], 7, 3, 9, 7, 11, 10],
      "circle-color": ["match", ["get", "pads"],
        "busy", paint.busy, "full", paint.full, "closed", paint.closed, paint.free],
      "circle-stroke-color": paint.halo, "circle-stroke-width": 1.5,
    }},
  ];
}
