// Which share of the packages came by their P90, in the last day and week: 88 to 92 % is as it should be.

import {useEffect, useState} from "preact/hooks";

import {get} from "../api.js";
import {html} from "../html.js";
import {shortId} from "../words.js";

// Milliseconds of wall time between two questions.
const ASK_EVERY_MS = 60_000;
const LEAST = 0.88;
const MOST = 0.92;

function usePromises() {
  const [items, setItems] = useState(null);
  useEffect(() => {
    let isShown = true;
    const show = (found) => isShown && setItems(found);
    const ask = () => get("/v1/stats/promises").then((answer) => show(answer.items), () => show(null));
    ask();
    const timer = setInterval(ask, ASK_EVERY_MS);
    return () => {
      isShown = false;
      clearInterval(timer);
    };
  }, []);
  return items;
}

const isOff = (share) => share !== null && (share < LEAST || share > MOST);

const shareText = ({p90_share: share, packages}) =>
  share === null ? "" : `${(share * 100).toFixed(1)} % of ${packages}`;

// Of one provider, or of all networks and providers without an id.
export function Promises({providerId = null}) {
  const items = usePromises();
  if (items === null) return null;
  const shown = providerId === null ? items : items.filter((each) => each.provider_id === providerId);
  return html`
    <h2>Packages by their P90</h2>
    ${shown.length === 0 ? html`<p>No package with a P90 was delivered in the last week.</p>` : html`
      <div class="table"><table aria-label="Packages by their P90">
        <thead><tr><th>Network</th><th>Provider</th><th>Last day</th><th>Last week</th></tr></thead>
        <tbody>
          ${shown.map(({network_id: network, provider_id: provider, day, week}) => html`
            <tr key=${`${network} ${provider}`}>
              <td>${network ?? "not known"}</td>
              <td>${provider ? shortId(provider) : "all"}</td>
              <td class=${isOff(day.p90_share) ? "late" : ""}>${shareText(day)}</td>
              <td class=${isOff(week.p90_share) ? "late" : ""}>${shareText(week)}</td>
            </tr>`)}
        </tbody>
      </table></div>`}`;
}
