// The events of a delivery, from its first to its last, as they come.

import {useEffect, useState} from "preact/hooks";

import {followStream} from "../follow_stream.js";
import {html} from "../html.js";
import {durationText, inWords, momentText} from "../words.js";

const LAST = ["completed", "partially_completed", "cancelled", "failed", "rejected"]
  .map((name) => `delivery.${name}`);
export const TYPES = [
  ...LAST,
  ...["requested", "changed", "scheduled", "planned", "promised", "dispatched"]
    .map((name) => `delivery.${name}`),
  ...["loaded", "started", "proof_awaited", "delayed", "replanned"]
    .map((name) => `delivery.${name}`),
  ...["delivered", "returned", "stranded", "cancelled"].map((name) => `package.${name}`),
];

// A stream that is opened again begins with the first event.
const withEvent = (before, event) =>
  before.some(({event_id: id}) => id === event.event_id) ? before : [...before, event];

// Calls `take` with each event up to the last one; the answer is a function that ends this.
const followEvents = (url, take) => followStream(url, (stream) => {
  for (const type of TYPES) {
    stream.addEventListener(type, ({data}) => {
      take(JSON.parse(data));
      // After its last event the stream ends; the browser would ask for it again and again.
      if (LAST.includes(type)) stream.close();
    });
  }
});

// The events so far; `onProofAwaited` is called when a drone waits for a proof.
export function useDeliveryEvents(path, onProofAwaited) {
  const [events, setEvents] = useState([]);
  useEffect(() => {
    setEvents([]);
    return followEvents(`${path}/events`, (event) => {
      setEvents((before) => withEvent(before, event));
      if (event.type === "delivery.proof_awaited") onProofAwaited();
    });
  }, [path]);
  return events;
}

export const DeliveryEvents = ({events}) => html`
  <ol class="timeline" aria-label="What happened">
    ${events.map((event) => html`<${Event} key=${event.event_id} event=${event} />`)}
  </ol>`;

// How much later or earlier than booked each package comes by a new plan; a second is nothing.
const delays = (packages = []) => packages
  .filter(({later_s}) => typeof later_s === "number")
  .map(({package_id, later_s}) => (Math.abs(later_s) < 1 ? `${package_id} as planned`
    : `${package_id} ${durationText(later_s)} ${later_s > 0 ? "later" : "earlier"} than planned`))
  .join(", ");

// "package.delivered" is "Package delivered".
const nameOf = (type) => inWords(type.replace(".", " "));

function Event({event: {type, occurred_at, data}}) {
  return html`
    <li>
      <time>${momentText(occurred_at)}</time>
      <strong>${nameOf(type)}</strong>
      ${data.package_id && ` ${data.package_id}`}
      ${data.code && html` <span class="tag">${inWords(data.code)}</span>`}
      ${data.detail && ` ${data.detail}`}
      ${delays(data.packages) && html`<br /><small>${delays(data.packages)}</small>`}
      ${data.given_up && html`<br /><small>Given up: ${inWords(data.given_up)}</small>`}
    </li>`;
}
