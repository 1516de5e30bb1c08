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

async function readFile(name) {
  const answer = await fetch(absolute(name)).catch(() => null);
  return answer?.status === 200 ? answer.json() : null;
}

// The styles for light and dark screens and the named places, or null without a map. A style may name
// the other two in its `metadata`.
export async function readOwnMap() {
  const light = await readFile("style.json");
  if (light === null) return null;
  addProtocol("pmtiles", new Protocol().tile);
  const {"skyway:dark": darkName, "skyway:places": placesName} = light.metadata ?? {};
  const dark = typeof darkName === "string" ? await readFile(darkName) : null;
  const places = typeof placesName === "string" ? await readFile(placesName) : null;
  return {
    light: withAbsoluteAddresses(light), dark: withAbsoluteAddresses(dark ?? light), places: places ?? [],
  };
}
