// The offers of a quote side by side, why other providers make none, and taking one.

import {useEffect, useRef, useState} from "preact/hooks";

import {post} from "../api.js";
import {ticks} from "../fleet_clock.js";
import {html} from "../html.js";
import {openView} from "../routes.js";
import {durationText, inWords, marginText, money, momentText, shortId, stationName} from "../words.js";
import {attempt} from "./messages.js";
import {OfferNotes} from "./offer_notes.js";
import {beginAgain, offeredWays, people} from "./request_draft.js";
import {ShareBar} from "./share_bar.js";

const METRES_PER_KM = 1_000;
const JOULES_PER_WH = 3_600;

const lastAt = ({packages}) => packages.map(({eta_at}) => eta_at).sort().at(-1);

// By when nine of ten such deliveries are complete; nothing before that is known.
const p90Text = ({packages}) => {
  const last = packages.map(({eta_p90_at: p90}) => p90).filter(Boolean).sort().at(-1);
  return last ? html`<br /><small>nine of ten by ${momentText(last)}</small>` : "";
};

const wayText = (ways) => ways.map((way) => way.map(stationName).join(" – ")).join("; ");

function OfferRow({offer, quote, most, name, isOpen, isChosen, onChoose, onTake}) {
  const {price, delivery_time_s: time, distance_m: distance, recharges, energy_j: energy} = offer;
  return html`
    <tr data-offer=${offer.offer_id} class=${isChosen ? "chosen" : ""} onMouseEnter=${onChoose}
      onFocusCapture=${onChoose}>
      <td><strong>${name}</strong><br /><small>${offer.drone_model_id}</small></td>
      <td>${money(price)}${offer.pooled_price && html`<br /><small>${money(offer.pooled_price)} if shared</small>`}<${ShareBar} share=${price.amount / most.price} kind="price" /></td>
      <td>${durationText(time)}<${ShareBar} share=${time / most.time} kind="time" /></td>
      <td data-label="Pickup">${momentText(offer.pickup_at)}${offer.pickup_station_id && html`
        <br /><small>${stationName(offer.pickup_station_id)}</small>`}</td>
      <td data-label="Delivered">${momentText(lastAt(offer))}${p90Text(offer)}
        ${offer.packages.length > 1 && offer.packages.map(({package_id, eta_at}) => html`
          <br /><small>${package_id}: ${momentText(eta_at)}</small>`)}</td>
      <td>${(distance / METRES_PER_KM).toFixed(1)} km${recharges > 0
        ? `, charges ${recharges === 1 ? "once" : `${recharges} times`}` : ""}${offer.trips > 1
        ? `, ${offer.trips} trips` : ""}
        <br /><small>${Math.round(energy / JOULES_PER_WH)} Wh${offer.is_held ? ", kept for you" : ""}</small>
        <br /><small>${wayText(offer.ways)}</small>
        ${marginText(offer.margins) && html`<br /><small>${marginText(offer.margins)}</small>`}
        <${OfferNotes} offer=${offer} quote=${quote} /></td>
      <td><button class="main" disabled=${!isOpen} onClick=${onTake}
        aria-label=${`Take the offer of ${name}`}>Take it</button></td>
    </tr>`;
}

function Infeasible({reasons, names}) {
  return reasons.length > 0 && html`
    <h3>${reasons.length === 1 ? "Why there is no other offer" : "Why there are no other offers"}</h3>
    <ul class="reasons">
      ${reasons.map(({provider_id: provider, code, detail, is_temporary}) => html`
        <li><strong>${inWords(code)}</strong>${provider ? ` (${names[provider] ?? shortId(provider)})` : ""}:
          ${" "}${detail}${is_temporary ? " Ask again later." : ""}</li>`)}
    </ul>`;
}

export function OfferTable({quote, names}) {
  ticks.value; // read so that the time that is left is right each second
  const section = useRef(null);
  const [isBusy, setBusy] = useState(false);
  const [chosen, setChosen] = useState(quote.offers[0]?.offer_id);
  useEffect(() => {
    offeredWays.value = quote.offers.map(({offer_id, ways}) => ({ways, isChosen: offer_id === chosen}));
    return () => (offeredWays.value = []);
  }, [quote, chosen]);
  useEffect(() => section.current.scrollIntoView({block: "nearest"}), []);
  const {quote_id, offers, infeasible, expires_wall_at} = quote;
  // Offers end in wall time, unlike what they promise.
  const leftS = (Date.parse(expires_wall_at) - Date.now()) / 1_000;
  const most = {
    price: Math.max(...offers.map(({price}) => price.amount), 1),
    time: Math.max(...offers.map(({delivery_time_s}) => delivery_time_s), 1),
  };

  async function take({offer_id}) {
    setBusy(true);
    await attempt(async () => {
      // The same offer is taken once, however often somebody presses the button.
      const headers = {"Idempotency-Key": `take-${offer_id}`};
      const {delivery_id} = await post("/v1/deliveries", {quote_id, offer_id, ...people()}, headers);
      beginAgain();
      openView("deliveries", delivery_id);
    }, "The delivery is requested.");
    setBusy(false);
  }

  return html`
    <section ref=${section} aria-label="Answer" aria-live="polite">
      <h2>${offers.length === 0 ? "Nobody can fly this" : "Offers"}</h2>
      ${offers.length > 0 && html`
        <p class="hint">${leftS > 0
          ? `The best one is first. They hold for another ${durationText(leftS)}.`
          : "These offers have ended. Ask for new ones."} The map shows their ways.</p>
        <div class="table"><table class="offers" aria-label="Offers">
          <thead><tr><th>Provider</th><th>Price</th><th>Takes</th><th>Pickup</th><th>Delivered</th>
            <th>Way</th><th><span class="unseen">Take</span></th></tr></thead>
          <tbody>${offers.map((offer) => html`
            <${OfferRow} key=${offer.offer_id} offer=${offer} quote=${quote} most=${most}
              name=${names[offer.provider_id] ?? shortId(offer.provider_id)}
              isOpen=${leftS > 0 && !isBusy} isChosen=${offer.offer_id === chosen}
              onChoose=${() => setChosen(offer.offer_id)} onTake=${() => take(offer)} />`)}</tbody>
        </table></div>`}
      <${Infeasible} reasons=${infeasible} names=${names} />
    </section>`;
}
