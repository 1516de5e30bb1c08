// Draws on the map what a command would change, while somebody is asked about it.

import {effect} from "@preact/signals";

import {hasMap, preview} from "../preview.js";
import {colours} from "./colours.js";
import {feature, line} from "./geojson.js";
import {overlay} from "./overlay.js";

const PADDING_PX = 80;

const shapes = ({lines, places}) => [
  ...lines.map((each) => line(each)),
  ...places.map(({position, kind}) => feature("Point", position, {kind})),
];

function layers() {
  const paint = colours();
  const colour = ["match", ["get", "kind"], "closed", paint.zone, "landing", paint.free, paint.selected];
  return [
    {id: "preview-lines", type: "line", filter: ["==", ["geometry-type"], "LineString"],
      paint: {"line-color": paint.selected, "line-width": 4, "line-dasharray": [1, 1.2]}},
    {id: "preview-places", type: "circle", filter: ["==", ["geometry-type"], "Point"],
      paint: {"circle-radius": 16, "circle-opacity": 0, "circle-stroke-width": 4, "circle-stroke-color": colour}},
  ];
}

// What is not in the picture comes into it.
function bringIntoView(map, features) {
  const points = features.filter(({geometry}) => geometry.type === "Point").map(({geometry}) => geometry.coordinates);
  const bounds = map.getBounds();
  if (points.every((point) => bounds.contains(point))) return;
  points.forEach((point) => bounds.extend(point));
  map.fitBounds(bounds, {padding: PADDING_PX});
}

// The answer is a function that ends this.
export function showPreviews({map}) {
  const draw = overlay(map, "preview", layers);
  hasMap.value = true;
  const stop = effect(() => bringIntoView(map, draw(shapes(preview.value)).features));
  return () => {
    stop();
    hasMap.value = false;
  };
}
