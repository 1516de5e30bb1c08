// What people ordered for a delivery and its missions, from the audit log; only for operators.

import {get} from "../api.js";
import {html} from "../html.js";
import {useRead} from "../use_read.js";
import {momentText} from "../words.js";
import {Fold} from "./fold.js";

const read = (path) => get(`/v1/audit?limit=50&path=${encodeURIComponent(path)}`);

// Bodies are kept as they came, and cut where they are long.
function reasonOf(body) {
  try {
    return JSON.parse(body).reason;
  } catch {
    return null;
  }
}

// `path` is that of the delivery; `changed` is anything that changes when there may be more.
export function DeliveryAudit({path, missions, changed}) {
  const paths = [path, ...missions.map(({mission_id}) => `/v1/missions/${mission_id}`)];
  const {answer} = useRead(() => Promise.all(paths.map(read)), {changed: `${paths} ${changed}`});
  const entries = (answer ?? []).flatMap(({items}) => items).sort((one, other) => one.at.localeCompare(other.at));
  return html`
    <${Fold} title="Who ordered what">
    ${entries.length === 0 && html`<p>Operators and providers have ordered nothing.</p>`}
    <ul class="timeline" aria-label="Who ordered what">
      ${entries.map(({entry_id, at, role, subject_id, method, path: called, status, body}) => html`
        <li key=${entry_id}>
          <time>${momentText(at)}</time><strong>${subject_id}</strong> (${role}) ${method} ${called},
          ${" "}answered with ${status}${reasonOf(body) ? `: ${reasonOf(body)}` : ""}
        </li>`)}
    </ul></${Fold}>`;
}
