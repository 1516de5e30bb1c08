// Which share of the packages came by their P90, in the last day and week: 88 to 92 % is as it should be.

import {html} from "../html.js";
import {useReadPath} from "../use_read.js";
import {shortId, wordsOfId} from "../words.js";

// Milliseconds of wall time between two questions.
const ASK_EVERY_MS = 60_000;
const LEAST = 0.88;
const MOST = 0.92;

const isOff = (share) => share !== null && (share < LEAST || share > MOST);

const shareText = ({p90_share: share, packages}) =>
  share === null ? "" : `${(share * 100).toFixed(1)} % of ${packages}`;

const WEATHER_WORDS = {CALM: "Calm", WINDY: "Windy", STORMY: "Stormy", COLD: "Cold"};
const KNOWN_WORDS = {FORECAST: "by the forecast", MEASURED: "by drones in flight"};
const RECHARGES = [0, 1, 2, 3];

const groupTitle = ({weather, known_by: knownBy}) =>
  weather === null ? "Not known" : `${WEATHER_WORDS[weather]}, ${KNOWN_WORDS[knownBy]}`;

const rechargesText = (number) =>
  number === 3 ? "3 or more recharges" : `${number} recharge${number === 1 ? "" : "s"}`;

// The share of some groups together.
const together = (groups) => {
  const packages = groups.reduce((sum, each) => sum + each.packages, 0);
  const inTime = groups.reduce((sum, each) => sum + each.packages * each.p90_share, 0);
  return {packages, p90_share: packages === 0 ? null : inTime / packages};
};

function Cell({label, groups}) {
  const share = together(groups);
  return html`<td data-label=${label}>${shareText(share)}</td>`;
}

// The last packages by what was known when they were promised.
function Groups({groups}) {
  const titles = [...new Set(groups.map(groupTitle))];
  return html`
    <h3>By weather and recharges</h3>
    <div class="table"><table class="as-cards" aria-label="By weather and recharges">
      <thead><tr><th>Weather</th><th>All</th>
        ${RECHARGES.map((each) => html`<th key=${each}>${rechargesText(each)}</th>`)}</tr></thead>
      <tbody>
        ${titles.map((title) => {
          const own = groups.filter((each) => groupTitle(each) === title);
          return html`
            <tr key=${title}>
              <td class="title">${title}</td>
              <${Cell} label="All" groups=${own} />
              ${RECHARGES.map((each) => html`<${Cell} key=${each} label=${rechargesText(each)}
                groups=${own.filter(({recharges}) => recharges === each)} />`)}
            </tr>`;
        })}
      </tbody>
    </table></div>`;
}

// Of one provider, or of all networks and providers without an id.
export function Promises({providerId = null}) {
  const {answer} = useReadPath("/v1/stats/promises", {everyMs: ASK_EVERY_MS});
  if (answer === null) return null;
  const {items, groups} = answer;
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
      </table></div>`}
    ${groups.length > 0 && html`<${Groups} groups=${groups} />`}`;
}
