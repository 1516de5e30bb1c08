// The offers of a quote side by side, why other providers make none, and taking one.

import {useEffect, useRef, useState} from "preact/hooks";

import {WORDS} from "../desk_words.js";
import {ticks} from "../fleet_clock.js";
import {html} from "../html.js";
import {distanceText, durationText, inWords, marginText, money, momentText, shortId, stationName}
  from "../words.js";
import {attempt} from "./messages.js";
import {OfferNotes} from "./offer_notes.js";
import {offeredWays, requestDelivery} from "./request_draft.js";
import {useBusy} from "./use_busy.js";

const METRES_PER_KM = 1_000;
const JOULES_PER_WH = 3_600;
const TEXT = WORDS.offers;
const GONE = new Set(["OFFER_LOST", "QUOTE_EXPIRED"]);

const lastOf = (packages, name) => packages.map((each) => each[name]).filter(Boolean).sort().at(-1);

const wayText = (ways) => ways.map((way) => way.map(stationName).join(" – ")).join("; ");

// For those who look closer.
function Details({offer, quote}) {
  const {distance_m: distance, recharges, trips, energy_j: energy, ways, margins, packages} = offer;
  const charges = recharges > 0 ? `, charges ${recharges === 1 ? "once" : `${recharges} times`}` : "";
  const flown = `${(distance / METRES_PER_KM).toFixed(1)} km${charges}${trips > 1 ? `, ${trips} trips` : ""}`;
  const lines = [
    `${flown}, ${Math.round(energy / JOULES_PER_WH)} Wh`,
    wayText(ways),
    ...(packages.length > 1 ? packages.map(({package_id: id, eta_at: eta}) => `${id}: ${momentText(eta)}`) : []),
    marginText(margins),
  ].filter(Boolean);
  return html`
    <details class="more"><summary>${TEXT.more}</summary>
      ${lines.map((line) => html`<p>${line}</p>`)}
      <${OfferNotes} offer=${offer} quote=${quote} />
    </details>`;
}

function OfferCard({offer, quote, name, isBest, isOpen, isChosen, onChoose, onTake}) {
  const eta = lastOf(offer.packages, "eta_at");
  const p90 = lastOf(offer.packages, "eta_p90_at");
  const station = offer.pickup_station_id && stationName(offer.pickup_station_id);
  const pickup = TEXT.pickup(momentText(offer.pickup_at), station);
  return html`
    <li class=${`card offer ${isChosen ? "chosen" : ""}`} data-offer=${offer.offer_id} onMouseEnter=${onChoose}
      onFocusCapture=${onChoose}>
      <p class="who">${name}, ${offer.drone_model_id}${isBest && html`<span class="best">${TEXT.best}</span>`}</p>
      <p class="sum">${money(offer.price)}</p>
      ${offer.pooled_price && html`<p class="hint">${TEXT.shared(money(offer.pooled_price))}</p>`}
      <p class="when">${p90 ? TEXT.likely(momentText(p90)) : TEXT.expected(momentText(eta))}</p>
      <p class="hint">${p90 ? `${TEXT.expected(momentText(eta))}, ` : ""}${distanceText(eta)}</p>
      <p class="hint">${pickup}${offer.is_held ? `. ${TEXT.held}` : ""}</p>
      <${Details} offer=${offer} quote=${quote} />
      <button class="main" disabled=${!isOpen} onClick=${onTake} aria-label=${TEXT.takeOf(name)}>
        ${TEXT.take}</button>
    </li>`;
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

// Without an offer, but with drones that are free later: how long the wait probably is.
function Busy({reasons, onRequest}) {
  const free = reasons.map(({data}) => data?.free_at).filter(Boolean).sort()[0];
  const wait = free ? TEXT.wait(distanceText(free).replace(/^in /, "")) : TEXT.waitUnknown;
  return html`<p>${wait}</p><button class="main" onClick=${onRequest}>${WORDS.request.orderAnyway}</button>`;
}

export function OfferCards({quote, names, onAsk, onRequest}) {
  ticks.value; // read so that the time that is left is right each second
  const section = useRef(null);
  const [isBusy, busy] = useBusy();
  const [chosen, setChosen] = useState(quote.offers[0]?.offer_id);
  useEffect(() => {
    offeredWays.value = quote.offers.map(({offer_id, ways}) => ({ways, isChosen: offer_id === chosen}));
    return () => (offeredWays.value = []);
  }, [quote, chosen]);
  useEffect(() => section.current.scrollIntoView({block: "start"}), []);
  const {quote_id, offers, infeasible, expires_wall_at} = quote;
  // Offers end in wall time, unlike what they promise.
  const leftS = (Date.parse(expires_wall_at) - Date.now()) / 1_000;
  const isWaiting = offers.length === 0 && infeasible.some(({code}) => code === "BUSY");

  const take = ({offer_id}) => busy(() => attempt(async () => {
    // The same offer is taken once, however often somebody presses the button.
    const headers = {"Idempotency-Key": `take-${offer_id}`};
    await requestDelivery({quote_id, offer_id}, headers).catch(async (refusal) => {
      if (!GONE.has(refusal.problem?.code)) throw refusal;
      await onAsk();
      throw new Error(TEXT.gone);
    });
  }, "The delivery is requested."));

  return html`
    <section ref=${section} aria-label="Answer" aria-live="polite">
      <h2>${offers.length > 0 ? TEXT.title(offers.length) : isWaiting ? TEXT.busy : TEXT.none}</h2>
      ${isWaiting && html`<${Busy} reasons=${infeasible} onRequest=${onRequest} />`}
      ${offers.length > 0 && html`
        <p class="hint">${leftS > 0 ? TEXT.holds(durationText(leftS)) : TEXT.over}</p>
        <ul class="cards offers" aria-label="Offers">
          ${offers.map((offer, number) => html`
            <${OfferCard} key=${offer.offer_id} offer=${offer} quote=${quote}
              isBest=${number === 0 && offers.length > 1}
              name=${names[offer.provider_id] ?? shortId(offer.provider_id)}
              isOpen=${leftS > 0 && !isBusy} isChosen=${offer.offer_id === chosen}
              onChoose=${() => setChosen(offer.offer_id)} onTake=${() => take(offer)} />`)}
        </ul>`}
      <${Infeasible} reasons=${infeasible} names=${names} />
    </section>`;
}
