// The live picture: follows GET /v1/live and keeps each kind of it in a signal.

import {batch, computed, signal} from "@preact/signals";

import {get} from "./api.js";
import {onWake} from "./wakes.js";

export const KINDS = ["drones", "missions", "deliveries", "stations", "closures", "alarms", "services"];

// By kind: an object of items by their ids.
export const picture = Object.fromEntries(KINDS.map((kind) => [kind, signal({})]));

// Whether changes arrive: "opening", "open" or "lost".
export const connection = signal("opening");

const AGAIN_MS = 2_000;
let stream = null;
let again = null;

// The document after a merge patch (RFC 7396); the given one is left as it is.
export function merged(target, patch) {
  if (typeof patch !== "object" || patch === null || Array.isArray(patch)) return patch;
  const result = typeof target === "object" && target !== null ? {...target} : {};
  for (const [name, value] of Object.entries(patch)) {
    if (value === null) delete result[name];
    else result[name] = merged(result[name], value);
  }
  return result;
}

export function followPicture() {
  leavePicture();
  let hasSnapshot = false;
  stream = new EventSource("/v1/live");
  // The browser has connected again, and the stream goes on where it was: perhaps nothing has changed.
  stream.addEventListener("open", () => {
    if (hasSnapshot) connection.value = "open";
  });
  stream.addEventListener("snapshot", ({data}) => {
    hasSnapshot = true;
    showWhole(JSON.parse(data));
  });
  stream.addEventListener("change", ({data}) => showChange(JSON.parse(data)));
  stream.addEventListener("error", () => {
    connection.value = "lost";
    // The browser connects again by itself, except after a refusal.
    if (stream?.readyState === EventSource.CLOSED) again = setTimeout(askAgain, AGAIN_MS);
  });
}

async function askAgain() {
  // An ended session shows itself here, and the console asks for a key.
  const refusal = await get("/v1/sessions/current").then(() => null, (reason) => reason);
  if (refusal?.status !== 401) followPicture();
}

function leavePicture() {
  clearTimeout(again);
  stream?.close();
  stream = null;
}

onWake(() => {
  if (stream !== null) followPicture();
});

// Nothing of one session is seen in the next.
export function forgetPicture() {
  leavePicture();
  showWhole({});
  connection.value = "opening";
}

function showWhole(document) {
  batch(() => {
    connection.value = "open";
    for (const kind of KINDS) picture[kind].value = document[kind] ?? {};
  });
}

function showChange(patch) {
  batch(() => {
    connection.value = "open";
    for (const [kind, changes] of Object.entries(patch)) {
      if (kind in picture) picture[kind].value = merged(picture[kind].value, changes ?? {});
    }
  });
}

// The missions that fly with this mission, as guests; customers see only their own missions.
export const guestsOf = (missionId) =>
  Object.values(picture.missions.value).filter(({flown_as: host}) => host === missionId);

export const openAlarms = computed(() =>
  Object.entries(picture.alarms.value)
    .map(([alarm_id, alarm]) => ({alarm_id, ...alarm}))
    .sort((one, other) => Date.parse(other.at) - Date.parse(one.at)));
