// Which share of the packages came by their P90, in the last day and week: 88 to 92 % is as it should be.

import {html} from "../html.js";
import {useReadPath} from "../use_read.js";
import {shortId, wordsOfId} from "../words.js";
import {Table} from "./table.js";

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

// The last packages by what was known when they were promised.
function Groups({groups}) {
  const titles = [...new Set(groups.map(groupTitle))];
  const own = (title) => groups.filter((each) => groupTitle(each) === title);
  const shareOf = (title, recharges) =>
    shareText(together(own(title).filter((each) => each.recharges === recharges)));
  return html`
    <h3>By weather and recharges</h3>
    <${Table} label="By weather and recharges" items=${titles} row=${(key) => ({key})} columns=${[
      ["Weather", (title) => title, "title"],
      ["All", (title) => shareText(together(own(title)))],
      ...RECHARGES.map((each) => [rechargesText(each), (title) => shareOf(title, each)]),
    ]} />`;
}

const shareCell = (share) => html`<span class=${isOff(share.p90_share) ? "late" : ""}>${shareText(share)}</span>`;

const COLUMNS = [
  ["Network", ({network_id: network}) => (network ? wordsOfId(network) : "not known"), "title"],
  ["Provider", ({provider_id: provider}) => (provider ? shortId(provider) : "all")],
  ["Last day", ({day}) => shareCell(day)],
  ["Last week", ({week}) => shareCell(week)],
];

// Of one provider, or of all networks and providers without an id.
export function Promises({providerId = null}) {
  const {answer} = useReadPath("/v1/stats/promises", {everyMs: ASK_EVERY_MS});
  if (answer === null) return null;
  const {items, groups} = answer;
  const shown = providerId === null ? items : items.filter((each) => each.provider_id === providerId);
  return html`
    <h2>Packages by their P90</h2>
    ${shown.length === 0 ? html`<p>No package with a P90 was delivered in the last week.</p>` : html`
      <${Table} label="Packages by their P90" items=${shown} columns=${COLUMNS} />`}
    ${groups.length > 0 && html`<${Groups} groups=${groups} />`}`;
}
