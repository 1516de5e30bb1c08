// What is closed at the moment that the map shows: now, or some hours ahead.

import {computed, signal} from "@preact/signals";

import {fleetNow, ticks} from "./fleet_clock.js";
import {picture} from "./live.js";
import {durationText, momentText} from "./words.js";

const HOUR_MS = 3_600_000;

// How far ahead the map shows what is closed.
export const hoursAhead = signal(0);

export const hasBegun = ({from_at: from}, ms = fleetNow()) => Date.parse(from) <= ms;

const holdsAt = (closure, ms) =>
  hasBegun(closure, ms) && (!closure.until || ms < Date.parse(closure.until));

const shownIds = computed(() => {
  ticks.value; // read so that closures begin and end by themselves
  const ms = fleetNow() + hoursAhead.value * HOUR_MS;
  const shown = Object.entries(picture.closures.value).filter(([, closure]) => holdsAt(closure, ms));
  return shown.map(([closureId]) => closureId).join(" ");
});

// The closures by their ids. It changes only with them, not each second.
export const closedThen = computed(() => {
  const ids = shownIds.value.split(" ").filter(Boolean);
  const all = picture.closures.value;
  return Object.fromEntries(ids.filter((id) => all[id]).map((id) => [id, all[id]]));
});

export function aheadText() {
  return hoursAhead.value === 0 ? "now" : `in ${durationText(hoursAhead.value * 3_600)}`;
}

// "from 14:00 to 15:30", "until it is opened".
export function closureTimes(closure) {
  const from = hasBegun(closure) ? "" : `from ${momentText(closure.from_at)} `;
  return from + (closure.until ? `until ${momentText(closure.until)}` : "until it is opened");
}
