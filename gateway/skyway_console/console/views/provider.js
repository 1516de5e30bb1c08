// A provider's fleet: drones and enrolment, the loading desk, earnings, and exchanges with others.

import {useEffect, useState} from "preact/hooks";

import {all} from "../api.js";
import {html} from "../html.js";
import {pathTo} from "../routes.js";
import {isOperator, session} from "../session.js";
import {Earnings} from "../parts/earnings.js";
import {Exchanges} from "../parts/exchanges.js";
import {FleetDrones} from "../parts/fleet_drones.js";
import {LoadingDesk} from "../parts/loading_desk.js";
import {attempt} from "../parts/messages.js";

// By the second part of the address.
const TABS = {
  drones: {part: FleetDrones, name: "Drones"},
  loading: {part: LoadingDesk, name: "Loading desk"},
  earnings: {part: Earnings, name: "Earnings"},
  exchanges: {part: Exchanges, name: "Exchanges"},
};

// Null while an operator has no provider to choose.
function useProvider() {
  const [providers, setProviders] = useState(null);
  const [chosen, choose] = useState(isOperator() ? null : session.value.subject_id);
  useEffect(() => {
    attempt(async () => {
      const items = await all("/v1/providers");
      setProviders(items);
      if (isOperator()) choose(items[0]?.provider_id ?? null);
    });
  }, []);
  return {providers, chosen, choose};
}

function ProviderChoice({providers, chosen, onChoose}) {
  return html`
    <label>Provider<select value=${chosen} onChange=${({target}) => onChoose(target.value)}>
      ${providers.map(({provider_id: id, name}) => html`<option value=${id}>${name}</option>`)}
    </select></label>`;
}

export function ProviderView({parts: [wanted]}) {
  const {providers, chosen, choose} = useProvider();
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
      ${providers?.length === 0 && html`<p>No provider is registered yet.</p>`}
      ${chosen && html`<${TABS[open].part} key=${chosen} providerId=${chosen} />`}
    </div>`;
}
