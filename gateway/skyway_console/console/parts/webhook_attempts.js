// The attempts to notify a webhook, and sending past events again.

import {post} from "../api.js";
import {html} from "../html.js";
import {useReadPath} from "../use_read.js";
import {dayText, inWords} from "../words.js";
import {attempt} from "./messages.js";

const AGAIN_MS = 3_000;

function AttemptRow({each, onAgain}) {
  const {event_id, event_type, number, wall_at: at, duration_ms, outcome, status, detail} = each;
  return html`
    <tr>
      <td>${dayText(at)}</td>
      <td>${event_type}<br /><small>${event_id}</small></td>
      <td>${number}</td>
      <td class=${outcome === "DELIVERED" ? "" : "late"}>${inWords(outcome)}${status ? ` (${status})` : ""}
        ${detail && html`<br /><small>${detail}</small>`}</td>
      <td class="number">${duration_ms} ms</td>
      <td>${event_type !== "webhook.test" && html`
        <button class="small" aria-label=${`Send ${event_type} again`} onClick=${onAgain}>Send again</button>`}</td>
    </tr>`;
}

export function WebhookAttempts({path}) {
  const attempts = useReadPath(`${path}/attempts?limit=50`, {everyMs: AGAIN_MS}).answer?.items;

  const replay = (what) => attempt(() => post(`${path}/replay`, what), "What was found is sent again.");
  function replayDelivery(event) {
    event.preventDefault();
    replay({delivery_id: new FormData(event.target).get("delivery").trim()});
  }

  return html`
    <form class="row" onSubmit=${replayDelivery}>
      <label>Send all events of a delivery again <input name="delivery" required placeholder="dlv_…" /></label>
      <button>Send</button>
    </form>
    <table aria-label="Attempts">
      <thead><tr><th>When</th><th>Event</th><th>Attempt</th><th>Outcome</th><th>Took</th>
        <th><span class="unseen">Again</span></th></tr></thead>
      <tbody>
        ${(attempts ?? []).map((each) => html`
          <${AttemptRow} key=${each.attempt_id} each=${each}
            onAgain=${() => replay({event_ids: [each.event_id]})} />`)}
        ${attempts?.length === 0 && html`<tr><td colspan="6">No attempt yet.</td></tr>`}
      </tbody>
    </table>`;
}
