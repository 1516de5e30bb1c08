// The live picture: follows GET /v1/live and keeps each kind of it in a signal.

import {batch, computed, signal} from "@preact/signals";

import {get} from "./api.js";
import {followStream} from "./follow_stream.js";
import {merged} from "./merge_patch.js";
import {session} from "./session.js";
import {SharedStream} from "./shared_stream.js";
import {onHidden, onWake} from "./wakes.js";

export const KINDS = ["drones", "missions", "deliveries", "stations", "closures", "alarms", "services"];

// By kind: an object of items by their ids.
export const picture = Object.fromEntries(KINDS.map((kind) => [kind, signal({})]));

// Whether changes arrive: "opening", "open" or "lost".
export const connection = signal("opening");

// Whether a tone sounds when an alarm comes. A tab that listens for alarms keeps its stream when nobody sees it.
export const alarmSound = signal(false);

let shared = null;
let isWhole = false;

// When this page last heard of the gateway by the stream, in milliseconds of the page's life.
let heardMs = 0;
export const streamHeardMs = () => heardMs;

export function followPicture() {
  leavePicture();
  const mark = JSON.stringify(session.peek());
  shared = new SharedStream(`skyway-live ${mark}`, {
    open: (pass) => openStream(pass, mark),
    whole: () => (isWhole ? {type: "snapshot", state: connection.peek(), data: wholePicture()} : null),
    hear,
  });
}

const wholePicture = () => Object.fromEntries(KINDS.map((kind) => [kind, picture[kind].peek()]));

// Opens the event stream; the answer closes it.
const openStream = (pass, mark) => followStream("/v1/live", (stream) => {
  // The browser has connected again, and the stream goes on where it was: perhaps nothing has changed.
  stream.addEventListener("open", () => isWhole && pass({type: "state", state: "open"}));
  for (const type of ["snapshot", "change"]) {
    stream.addEventListener(type, ({data}) => pass({type, state: "open", data: JSON.parse(data)}));
  }
  stream.addEventListener("error", () => pass({type: "state", state: "lost"}));
}, () => isSameSession(mark));

// An ended session shows itself here, and the console asks for a key. Another tab may have logged in
// as somebody else: nothing that was read before stays in this page then.
async function isSameSession(mark) {
  const now = await get("/v1/sessions/current").catch((refusal) => refusal);
  if (now.status === 401) return false;
  if (now instanceof Error || JSON.stringify(now) === mark) return true;
  location.reload();
  return false;
}

function leavePicture() {
  shared?.leave();
  shared = null;
  isWhole = false;
}

// A tab that nobody sees holds no stream. When it comes back, its drones are placed: none glides
// from where it was long ago.
onHidden(() => alarmSound.peek() || leavePicture());
onWake(async () => {
  const own = session.peek();
  if (!own || !(await isSameSession(JSON.stringify(own))) || session.peek() !== own) return;
  connection.value = "opening";
  followPicture();
});

// Nothing of one session is seen in the next.
export function forgetPicture() {
  leavePicture();
  batch(() => {
    connection.value = "opening";
    for (const kind of KINDS) picture[kind].value = {};
  });
}

function hear({type, state, data}) {
  if (state === "open") heardMs = performance.now();
  if (type === "change" && !isWhole) return;
  if (type === "snapshot" && !isWhole) picture.drones.value = {};
  batch(() => {
    connection.value = state;
    if (type === "snapshot") showWhole(data);
    if (type === "change") showChange(data);
  });
}

function showWhole(document) {
  isWhole = true;
  for (const kind of KINDS) picture[kind].value = document[kind] ?? {};
}

function showChange(patch) {
  for (const [kind, changes] of Object.entries(patch)) {
    if (kind in picture) picture[kind].value = merged(picture[kind].value, changes ?? {});
  }
}

// The missions that fly with this mission, as guests; customers see only their own missions.
export const guestsOf = (missionId) =>
  Object.values(picture.missions.value).filter(({flown_as: host}) => host === missionId);

export const openAlarms = computed(() =>
  Object.entries(picture.alarms.value)
    .map(([alarm_id, alarm]) => ({alarm_id, ...alarm}))
    .sort((one, other) => Date.parse(other.at) - Date.parse(one.at)));
