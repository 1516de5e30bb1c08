// Which share of the packages came by their P90, in the last day and week: 88 to 92 % is as it should be.

import {html} from "../html.js";
import {usePolledPath} from "../polled.js";
import {shortId, wordsOfId} from "../words.js";

// Milliseconds of wall time between two questions.
const ASK_EVERY_MS = 60_000;
const LEAST = 0.88;
const MOST = 0.92;

const isOff = (share) => share !== null && (share < LEAST || share > MOST);

const shareText = ({p90_share: share, packages}) =>
  share === null ? "" : `${(share * 100).toFixed(1)} % of ${packages}`;

// Of one provider, or of all networks and providers without an id.
export function Promises({providerId = null}) {
  const {answer} = usePolledPath("/v1/stats/promises", ASK_EVERY_MS);
  if (answer === null) return null;
  const {items} = answer;
  const shown = providerId === null ? items : items.filter((each) => each.provider_id === providerId);
  return html`
    <h2>Packages by their P90</h2>
    ${shown.length === 0 ? html`<p>No package with a P90 was delivered in the last week.</p>` : html`
      <div class="table"><table class="as-cards" aria-label="Packages by their P90">
        <thead><tr><th>Network</th><th>Provider</th><th>Last day</th><th>Last week</th></tr></thead>
        <tbody>
          ${shown.map(({network_id: network, provider_id: provider, day, week}) => html`
            <tr key=${`${network} ${provider}`}>
              <td class="title">${network ? wordsOfId(network) : "not known"}</td>
              <td data-label="Provider">${provider ? shortId(provider) : "all"}</td>
              <td data-label="Last day" class=${isOff(day.p90_share) ? "late" : ""}>${shareText(day)}</td>
              <td data-label="Last week" class=${isOff(week.p90_share) ? "late" : ""}>${shareText(week)}</td>
            </tr>`)}
        </tbody>
      </table></div>`}`;
}
