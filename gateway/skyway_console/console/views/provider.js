// A provider's fleet: drones and enrolment, the loading desk, earnings, and exchanges with others.

import {useState} from "preact/hooks";

import {all} from "../api.js";
import {html} from "../html.js";
import {pathTo} from "../routes.js";
import {isOperator, session} from "../session.js";
import {useRead} from "../use_read.js";
import {Earnings} from "../parts/earnings.js";
import {Exchanges} from "../parts/exchanges.js";
import {FleetDrones} from "../parts/fleet_drones.js";
import {LoadingDesk} from "../parts/loading_desk.js";

// By the second part of the address.
const TABS = {
  drones: {part: FleetDrones, name: "Drones"},
  loading: {part: LoadingDesk, name: "Loading desk"},
  earnings: {part: Earnings, name: "Earnings"},
  exchanges: {part: Exchanges, name: "Exchanges"},
};

function ProviderChoice({providers, chosen, onChoose}) {
  return html`
    <label>Provider<select value=${chosen} onChange=${({target}) => onChoose(target.value)}>
      ${providers.map(({provider_id: id, name}) => html`<option value=${id}>${name}</option>`)}
    </select></label>`;
}

export function ProviderView({parts: [wanted]}) {
  const {answer: providers, problem} = useRead(() => all("/v1/providers"));
  const [choice, choose] = useState(isOperator() ? null : session.value.subject_id);
  const chosen = choice ?? providers?.[0]?.provider_id;
  const open = wanted in TABS ? wanted : "drones";
  const name = providers?.find(({provider_id}) => provider_id === chosen)?.name;
  return html`
    <div class="page">
      <h1>Fleet${!isOperator() && name ? ` of ${name}` : ""}</h1>
      <div class="filters">
        ${isOperator() && providers?.length > 0 && html`
          <${ProviderChoice} providers=${providers} chosen=${chosen} onChoose=${choose} />`}
        <nav class="tabs" aria-label="Parts of the fleet">
          ${Object.entries(TABS).map(([each, {name: text}]) => html`
            <a href=${pathTo("fleet", each)} aria-current=${each === open ? "page" : undefined}>${text}</a>`)}
        </nav>
      </div>
      ${problem && html`<p class="refused" role="alert">${problem}</p>`}
      ${providers?.length === 0 && html`<p>No provider is registered yet.</p>`}
      ${chosen && html`<${TABS[open].part} key=${chosen} providerId=${chosen} />`}
    </div>`;
}
