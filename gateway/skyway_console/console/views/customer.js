// A new delivery: what goes where, the offers for it, and taking one.

import {useEffect, useState} from "preact/hooks";

import {all, get, post} from "../api.js";
import {WORDS} from "../desk_words.js";
import {html} from "../html.js";
import {stationsOf} from "../map/features.js";
import {networks, showNetwork, shownNetwork} from "../networks.js";
import {useNetwork} from "../use_network.js";
import {useRead} from "../use_read.js";
import {stationName} from "../words.js";
import {attempt} from "../parts/messages.js";
import {OfferCards} from "../parts/offer_cards.js";
import {PlaceFinder} from "../parts/place_finder.js";
import {beginAgain, quoteRequest, requestDelivery, suggestPickup} from "../parts/request_draft.js";
import {RequestForm} from "../parts/request_form.js";
import {RequestMap} from "../parts/request_map.js";
import {ServiceStatus} from "../parts/service_status.js";
import {useBusy} from "../parts/use_busy.js";

// Names of providers by their ids; customers see each provider's card.
async function readNames() {
  const providers = await all("/v1/providers");
  return Object.fromEntries(providers.map(({provider_id, name}) => [provider_id, name]));
}

// A shop sends from the same place as last time, as a rule.
function usePickup(network) {
  useEffect(() => {
    if (!network) return;
    const known = new Set(stationsOf(network).map(({properties}) => properties.station_id));
    get("/v1/deliveries?limit=1").then(({items: [last]}) => {
      if (last && known.has(last.pickup.station_id)) suggestPickup(last.pickup.station_id);
    }, () => null);
  }, [network]);
}

const named = (network) => stationsOf(network)
  .map(({properties}) => properties)
  .sort((one, other) => one.station_id.localeCompare(other.station_id));

function choose({target}) {
  beginAgain();
  showNetwork(target.value);
}

const NetworkChoice = () => html`
  <div class="fields"><label>Network<select value=${shownNetwork.value} onChange=${choose}>
    ${networks.value.map(({network_id: id}) => html`<option value=${id}>${stationName(id)}</option>`)}
  </select></label></div>`;

export function CustomerView() {
  const {network, problem} = useNetwork();
  const names = useRead(readNames).answer ?? {};
  usePickup(network);
  const [quote, setQuote] = useState(null);
  const [refused, setRefused] = useState("");
  const [isBusy, busy] = useBusy();

  const ask = () => busy(async () => {
    setRefused("");
    setQuote(await post("/v1/quotes", quoteRequest()).catch((refusal) => {
      setRefused(refusal.message);
      return null;
    }));
  });

  // A delivery without an offer can join the trip of another one; an accepted offer cannot.
  function request() {
    const {hold, ...asked} = quoteRequest();
    return busy(() => attempt(() => requestDelivery(asked), "The delivery is requested."));
  }

  if (!network) {
    const hint = networks.value?.length === 0 ? "There are no stations yet." : "Reading the stations…";
    return html`<div class="page"><h1>${WORDS.request.title}</h1><p>${problem || hint}</p></div>`;
  }
  return html`
    <div class="page">
      <h1>${WORDS.request.title}</h1>
      <div class="request-view">
        <div>
          <p class="hint">${WORDS.request.hint}</p>
          ${networks.value?.length > 1 && html`<${NetworkChoice} />`}
          <${ServiceStatus} networkId=${shownNetwork.value} />
          <${PlaceFinder} network=${network} />
          <${RequestForm} stations=${named(network)} isBusy=${isBusy} onAsk=${ask} onRequest=${request} />
        </div>
        <div class="map-frame"><${RequestMap} network=${network} /></div>
      </div>
      ${refused && html`<p class="refused" role="alert">${refused}</p>`}
      ${quote && html`<${OfferCards} key=${quote.quote_id} quote=${quote} names=${names}
        onAsk=${ask} onRequest=${request} />`}
    </div>`;
}
