// From degrees to the screen. The map is never turned, so this is a product and a sum for each axis:
// MapLibre's own `project` does the same for one point, and takes too long for thousands of drones.

import {near} from "./longitudes.js";

const TILE_PX = 512;

// Longitude and latitude in degrees as shares of the world's width, from its middle, east and south.
export function mercator(position) {
  const [longitude, latitude] = near(position);
  const radians = (latitude * Math.PI) / 180;
  return [longitude / 360, -Math.log(Math.tan(Math.PI / 4 + radians / 2)) / (2 * Math.PI)];
}

// A function from such shares to pixels of the map as it is now: of all times round the world, the
// one that is nearest to the middle of the map, whose own longitude jumps at 180.
export function screenOf(map) {
  const middle = map.project([0, 0]);
  const worldPx = TILE_PX * 2 ** map.getZoom();
  const centre = (map.getContainer().clientWidth / 2 - middle.x) / worldPx;
  return ([right, down]) => [
    middle.x + (right - Math.round(right - centre)) * worldPx, middle.y + down * worldPx,
  ];
}

const EARTH_KM = 6371;

// The distance of two places, of [longitude, latitude] in degrees, along the great circle.
export function kilometres([west, south], [east, north]) {
  const radians = Math.PI / 180;
  const share = Math.sin(((north - south) * radians) / 2) ** 2
    + Math.cos(south * radians) * Math.cos(north * radians) * Math.sin(((east - west) * radians) / 2) ** 2;
  return 2 * EARTH_KM * Math.asin(Math.sqrt(share));
}
