// How old the picture is: it is as good as its oldest part.

import {computed} from "@preact/signals";

import {clockHeardMs, fleetNow, fleetRate, ticks} from "./fleet_clock.js";
import {connection, picture, streamHeardMs} from "./live.js";
import {capital, zonedText} from "./words.js";

// The gateway is asked for the time every 30 s. After two answers that did not come, nothing is live.
const NO_NEWS_MS = 70_000;

// What stands still while a service does not answer.
const FEEDS = {
  registry: "drones and their charge stand still",
  composition: "missions, pads and alarms stand still",
  gateway: "deliveries stand still",
};

// The services that do not answer, with the moment since when, by their names.
export const silentServices = computed(() =>
  Object.entries(picture.services.value).filter(([, {is_answering}]) => !is_answering));

const heardMs = () => Math.max(streamHeardMs(), clockHeardMs());

// "opening", "open", "partly" or "lost". It changes seldom, though it is looked at each second.
export const freshness = computed(() => {
  ticks.value;
  if (connection.value === "lost") return "lost";
  if (performance.now() - heardMs() > NO_NEWS_MS) return "lost";
  return connection.value === "open" && silentServices.value.length ? "partly" : connection.value;
});

// Classes of the view: what a silent service feeds is dimmed.
export const staleClasses = computed(() => {
  if (freshness.value === "lost") return "stale stale-all";
  const names = silentServices.value.map(([name]) => `stale-${/^\w+/.exec(name)[0]}`);
  return names.length ? ["stale", ...names].join(" ") : "";
});

function silenceText([name, {silent_since_at: since}]) {
  const when = since ? ` since ${zonedText(since)}` : "";
  return `${capital(name)} has not answered${when}: ${FEEDS[name] ?? "its part stands still"}.`;
}

// The sentences that say what is old and since when; none while all is live.
export function staleTexts() {
  if (freshness.value !== "lost") return silentServices.value.map(silenceText);
  const ago = (performance.now() - heardMs()) * fleetRate();
  return [`No connection. You see the picture of ${zonedText(fleetNow() - ago)}. The console tries again by itself.`];
}
