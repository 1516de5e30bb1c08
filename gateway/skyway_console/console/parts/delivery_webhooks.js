// Which webhooks were notified of a delivery's events, and whether they answered.

import {all, get, part} from "../api.js";
import {html} from "../html.js";
import {useRead} from "../use_read.js";
import {dayText, inWords} from "../words.js";

// So many of the last attempts of each webhook are looked through.
const LOOKED_AT = 200;

async function readAttempts() {
  const webhooks = await all("/v1/webhooks");
  const pages = await Promise.all(webhooks.map(({webhook_id: id}) =>
    get(`/v1/webhooks/${part(id)}/attempts?limit=${LOOKED_AT}`)));
  return pages.flatMap(({items}, number) => items.map((each) => ({...each, url: webhooks[number].url})));
}

// It asks when it is opened, because there may be many attempts.
export function DeliveryWebhooks({events}) {
  const {answer, problem} = useRead(readAttempts, {changed: events.length});
  const ids = new Set(events.map(({event_id: id}) => id));
  const own = (answer ?? []).filter(({event_id: id}) => ids.has(id));
  if (!answer && !problem) return html`<p>Reading…</p>`;
  if (own.length === 0) return html`<p>No webhook was notified lately. Keys shows how to add one.</p>`;
  return html`
    <ul class="timeline" aria-label="Webhooks">
      ${own.map(({attempt_id: id, event_type: type, url, outcome, status, detail, wall_at: at}) => html`
        <li key=${id}><time>${dayText(at)}</time><strong>${type}</strong> to ${url}:
          ${" "}<span class=${outcome === "DELIVERED" ? "" : "late"}>${inWords(outcome)}${status ? ` (${status})` : ""}</span>
          ${detail && html`<br /><small>${detail}</small>`}</li>`)}
    </ul>`;
}
