// Sums, rates, queues and failures from the figures of services: {name, labels, value}.

import {inWords} from "../words.js";

// Queues: the name of the depth, of the age, and the label that says which queue it is.
const QUEUES = [
  ["skyway_queue_depth", "skyway_queue_age_seconds", "queue"],
  ["skyway_outbox_depth", "skyway_outbox_age_seconds", "channel"],
  ["skyway_planning_depth", null, "queue"],
  ["skyway_missions_to_replan", null, null],
  ["skyway_mqtt_inbox_depth", "skyway_mqtt_inbox_age_seconds", null],
  ["skyway_telemetry_depth", null, null],
  ["skyway_quarantine_depth", null, null],
];

// Counters that stay at zero while all is well.
const FAILURES = /_(failures|trouble|dropped|lost|shed|unread|closed|unreadable|forged_messages)_total$|_put_out_total$/;

// The sum of all figures with this name; null without one.
export function sumOf(figures, name) {
  const found = figures.filter((figure) => figure.name === name);
  return found.length ? found.reduce((sum, {value}) => sum + value, 0) : null;
}

// How much a counter grew in a second; null before the second look, and after a restart.
export function rateBetween(before, now, name, elapsedS) {
  const [earlier, later] = [before ? sumOf(before, name) : null, sumOf(now, name)];
  if (earlier === null || later === null || !elapsedS || later < earlier) return null;
  return (later - earlier) / elapsedS;
}

// "skyway_outbox_depth" of the channel "mqtt" is "Outbox: mqtt".
function nameOf(metric, labels) {
  const words = inWords(metric.replace(/^skyway_/, "").replace(/_(depth|total)$/, ""));
  const about = Object.values(labels).join(", ");
  return about ? `${words}: ${about}` : words;
}

export function queues(services) {
  return services.flatMap(({service, figures}) => QUEUES.flatMap(([depthName, ageName, label]) =>
    figures.filter(({name}) => name === depthName).map(({labels, value}) => {
      const age = figures.find((figure) =>
        figure.name === ageName && (label === null || figure.labels[label] === labels[label]));
      return {
        service, name: nameOf(depthName, labels), depth: value,
        ageS: value > 0 && age ? age.value : null,
      };
    })));
}

export function failures(services) {
  return services.flatMap(({service, figures}) => figures
    .filter(({name, value}) => value > 0 && FAILURES.test(name))
    .map(({name, labels, value}) => ({service, name: nameOf(name, labels), count: value})));
}
