// Fleet time: it runs at its own rate, and moments of the API are in it.

import {signal} from "@preact/signals";

import {get} from "./api.js";

// What the gateway said, and when by this browser's clock.
let anchor = {fleetMs: Date.now(), readMs: Date.now(), rate: 1};

// When the gateway last gave the time, in milliseconds of the page's life.
let heardMs = 0;
export const clockHeardMs = () => heardMs;

const EVERY_MS = 1_000;
const READ_EVERY_MS = 30_000;

export const fleetNow = () => anchor.fleetMs + (Date.now() - anchor.readMs) * anchor.rate;
export const fleetRate = () => anchor.rate;

// Changes once a second, for what shows how long something still takes.
export const ticks = signal(0);

async function readClock() {
  const {now, rate} = await get("/v1/clock");
  anchor = {fleetMs: Date.parse(now), readMs: Date.now(), rate};
  heardMs = performance.now();
}

let isRunning = false;

// Whether the gateway was asked for the time. Before that, this browser's own time would be shown.
export const isClockAsked = signal(false);

export async function startClock() {
  if (isRunning) return;
  isRunning = true;
  setInterval(() => ticks.value += 1, EVERY_MS);
  setInterval(() => readClock().catch(() => null), READ_EVERY_MS);
  await readClock().catch(() => null);
  isClockAsked.value = true;
}
