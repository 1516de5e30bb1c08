// The operator's own base map, if there is one: a MapLibre style below /console-map/.

import {addProtocol} from "maplibre-gl";
import {Protocol} from "pmtiles";

const FOLDER = "/console-map/";

// Addresses of a style that begin with no scheme lie in its folder.
const isRelative = (address) => !/^([a-z]+:|\/)/i.test(address);
const absolute = (address) => {
  const [, scheme, path] = /^(pmtiles:\/\/)?(.*)$/.exec(address);
  return `${scheme ?? ""}${isRelative(path) ? `${location.origin}${FOLDER}${path}` : path}`;
};

function withAbsoluteAddresses(style) {
  const sources = Object.entries(style.sources ?? {}).map(([name, source]) => [name, {
    ...source,
    ...(source.url ? {url: absolute(source.url)} : {}),
    ...(source.tiles ? {tiles: source.tiles.map(absolute)} : {}),
    ...(typeof source.data === "string" ? {data: absolute(source.data)} : {}),
  }]);
  const named = ["glyphs", "sprite"].filter((name) => typeof style[name] === "string")
    .map((name) => [name, absolute(style[name])]);
  return {...style, sources: Object.fromEntries(sources), ...Object.fromEntries(named)};
}

// The style, or null without one.
export async function readOwnStyle() {
  const answer = await fetch(`${FOLDER}style.json`).catch(() => null);
  if (answer?.status !== 200) return null;
  addProtocol("pmtiles", new Protocol().tile);
  return withAbsoluteAddresses(await answer.json());
}
