// The events of a delivery, from its first to its last, as they come.

import {useEffect, useState} from "preact/hooks";

import {html} from "../html.js";
import {inWords, momentText} from "../words.js";

const LAST = ["completed", "partially_completed", "cancelled", "failed", "rejected"]
  .map((name) => `delivery.${name}`);
export const TYPES = [
  ...LAST,
  ...["requested", "scheduled", "planned", "dispatched", "loaded", "started", "delayed", "replanned"]
    .map((name) => `delivery.${name}`),
  ...["delivered", "returned", "stranded", "cancelled"].map((name) => `package.${name}`),
];

export function DeliveryEvents({path}) {
  const [events, setEvents] = useState([]);
  useEffect(() => {
    const stream = new EventSource(`${path}/events`);
    for (const type of TYPES) {
      stream.addEventListener(type, ({data}) => {
        setEvents((before) => [...before, JSON.parse(data)]);
        // After its last event the stream ends; the browser would ask for it again and again.
        if (LAST.includes(type)) stream.close();
      });
    }
    return () => stream.close();
  }, [path]);
  return html`
    <ol class="timeline" aria-label="What happened">
      ${events.map((event) => html`<${Event} key=${event.event_id} event=${event} />`)}
    </ol>`;
}

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
    </li>`;
}
