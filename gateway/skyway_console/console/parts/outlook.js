// What a dry run says about a mission: whether a plan is found, and what becomes of each package.

import {html} from "../html.js";
import {distanceText, durationText, momentText, stationName} from "../words.js";

// A reason that is a sentence begins with a capital letter and ends with a full stop.
const sentence = (text) => `${text.charAt(0).toUpperCase()}${text.slice(1)}.`;

function planText({plan, code, detail, ends_mission: endsMission}) {
  const why = detail ? ` ${sentence(detail)}` : "";
  switch (plan) {
    case "NEW_PLAN": return "A new plan is found.";
    case "NO_PLAN": return `No plan is found (${code}).${why}`;
    case "NO_PLAN_YET": return `No plan can be made yet (${code}).${why}`;
    case "TIME_UP": return "No plan was found in time. The mission may still get one.";
    default: return endsMission ? `The mission ends.${why}` : "No new plan is needed.";
  }
}

function laterText(seconds) {
  if (Math.abs(seconds) < 1) return "no later";
  return `${durationText(seconds)} ${seconds > 0 ? "later" : "earlier"}`;
}

function fateText({fate, station_id: station, later_by_s: laterByS, returns_at: returnsAt}) {
  const at = station ? ` at ${stationName(station)}` : "";
  switch (fate) {
    case "DELIVERED": return laterByS === null ? `delivered${at}` : laterText(laterByS);
    case "RETURNED": return `comes back${at}, ${momentText(returnsAt)}`;
    case "NOT_PICKED_UP": return `is not picked up${at}`;
    case "LEFT_BEHIND": return `is left behind${at}`;
    case "WAITS": return `waits${at}`;
    default: return "not known before a plan is found";
  }
}

const orDash = (moment) => (moment ? momentText(moment) : "–");

export function Outlook({outlook}) {
  const {next_landing: landing, packages, reported_at: reportedAt} = outlook;
  return html`
    <p>${planText(outlook)}</p>
    ${landing && html`<p>The drone lands next at ${stationName(landing.station_id)}, ${distanceText(landing.at)}.</p>`}
    ${packages.length === 0 ? html`<p>The mission has no package left.</p>` : html`
      <div class="table"><table aria-label="What becomes of the packages">
        <thead><tr><th>Package</th><th>Expected</th><th>Then</th><th>Change</th></tr></thead>
        <tbody>${packages.map((each) => html`
          <tr key=${each.package_id}>
            <td>${each.package_id}</td><td>${orDash(each.eta_at)}</td><td>${orDash(each.new_eta_at)}</td>
            <td>${fateText(each)}</td>
          </tr>`)}</tbody>
      </table></div>`}
    ${reportedAt && html`<p>Planned from the drone's report of ${momentText(reportedAt)}.</p>`}`;
}

// How much later the last package of a mission comes, in a few words.
export function delayText({plan, later_by_s: laterByS, code}) {
  if (laterByS !== null) return `its last package comes ${laterText(laterByS)}`;
  switch (plan) {
    case "NEW_PLAN": return "a new plan that does not deliver every package";
    case "NO_PLAN": return `no plan is found (${code})`;
    case "TIME_UP": return "no plan was found in time";
    case "NOT_NEEDED": return "no new plan is needed";
    default: return `no plan can be made yet (${code})`;
  }
}
