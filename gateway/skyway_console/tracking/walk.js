// The walk to a pad: where the reader stands stays in the browser.

import {WORDS, distanceText} from "./words.js";

const METRES_PER_DEGREE = 111_195;
const METRES_PER_MINUTE = 80;
const THERE_M = 25;
const DIRECTIONS = ["north", "northeast", "east", "southeast", "south", "southwest", "west", "northwest"];

// What is known of the reader's place: null before somebody asks, a text, or [longitude, latitude].
let standing = null;

export const standsAt = () => standing;

// Browsers give a place to secure pages only.
export const mayAsk = () => isSecureContext && "geolocation" in navigator && standing === null;

// Asks where the reader is; `changed` is called for each change of what is known.
export function locate(changed) {
  const know = (place) => {
    standing = place;
    changed();
  };
  know(WORDS.locating);
  navigator.geolocation.getCurrentPosition(
    ({coords}) => know([coords.longitude, coords.latitude]),
    () => know(WORDS.noPlace),
    {maximumAge: 60_000, timeout: 15_000},
  );
}

// The walk to this position in words; "" while nothing is known.
export function walkText([longitude, latitude]) {
  if (!Array.isArray(standing)) return standing ?? "";
  const east = (longitude - standing[0]) * Math.cos((latitude * Math.PI) / 180) * METRES_PER_DEGREE;
  const north = (latitude - standing[1]) * METRES_PER_DEGREE;
  const metres = Math.hypot(east, north);
  if (metres < THERE_M) return WORDS.isThere;
  const eighth = Math.round(Math.atan2(east, north) / (Math.PI / 4));
  return WORDS.walk(distanceText(metres), DIRECTIONS[(eighth + 8) % 8], Math.ceil(metres / METRES_PER_MINUTE));
}
