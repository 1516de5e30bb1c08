// Requests that wait for a drone: they are on nobody's calendar yet.

import {html} from "../html.js";
import {picture} from "../live.js";
import {pathTo} from "../routes.js";
import {momentText, placeName, shortId} from "../words.js";

const SHOWN = 50;

const waiting = () => Object.entries(picture.deliveries.value)
  .filter(([, {is_waiting: isWaiting}]) => isWaiting)
  .sort(([, one], [, other]) => one.created_at.localeCompare(other.created_at));

export function WaitingRequests() {
  const requests = waiting();
  return html`
    <h2>Waits for a drone</h2>
    ${requests.length === 0 && html`<p>No request waits for a drone.</p>`}
    <ul class="timeline" aria-label="Waits for a drone">
      ${requests.slice(0, SHOWN).map(([id, {created_at: since, pickup, packages, reference}]) => html`
        <li key=${id}><time>since ${momentText(since)}</time>
          <a href=${pathTo("deliveries", id)}>delivery ${shortId(id)}</a>${reference && ` (${reference})`}
          ${" "}from ${placeName(pickup)} to
          ${" "}${Object.values(packages).map(({destination}) => placeName(destination)).join(", ")}</li>`)}
      ${requests.length > SHOWN && html`<li>and ${requests.length - SHOWN} more</li>`}
    </ul>`;
}
