// Whether a network accepts deliveries now: what restricts it, before a customer asks for offers.

import {part} from "../api.js";
import {html} from "../html.js";
import {useReadPath} from "../use_read.js";
import {distanceText} from "../words.js";

// Milliseconds of wall time between two questions.
const ASK_EVERY_MS = 15_000;
// So many restrictions are shown; the others are counted.
const SHOWN = 5;

const TITLES = {
  PAUSED: "The service is paused: a request waits until drones may fly again.",
  DEGRADED: "Deliveries are accepted. Some things restrict them now.",
};

const untilText = ({until}) => (until ? ` (ends ${distanceText(until)})` : "");

const BUSY_TEXT = "All drones are busy or charging just now. Ask for offers all the same: each says when its drone "
  + "comes, and without an offer the next free drone flies your delivery.";

const restrictionText = (each) => (each.code === "NO_IDLE_DRONES" ? BUSY_TEXT : `${each.detail}${untilText(each)}`);

export function ServiceStatus({networkId}) {
  const {answer: status} = useReadPath(`/v1/networks/${part(networkId)}/status`, {everyMs: ASK_EVERY_MS});
  if (status === null || status.status === "OPEN") return null;
  const {restrictions, more_restrictions: further} = status;
  const isOnlyBusy = restrictions.every(({code}) => code === "NO_IDLE_DRONES");
  const hidden = Math.max(0, restrictions.length - SHOWN) + further;
  return html`
    <div class="service-status ${status.status.toLowerCase()}" role="status" aria-label="Service status">
      ${isOnlyBusy ? html`<p>${BUSY_TEXT}</p>` : html`
        <details class="more" open=${status.status === "PAUSED"}><summary>${TITLES[status.status]}</summary>
          <ul>
            ${restrictions.slice(0, SHOWN).map((each) => html`<li>${restrictionText(each)}</li>`)}
            ${hidden > 0 && html`<li>and ${hidden} more</li>`}
          </ul>
        </details>`}
    </div>`;
}
