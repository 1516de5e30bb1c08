// Notes below an offer: the walks to its stations, and its payment terms.

import {WORDS, termsText} from "../desk_words.js";
import {html} from "../html.js";
import {walkText} from "./place_finder.js";

// The station that an offer uses for a field of the request, such as `packages.0.destination`.
function stationAt(field, offer, request) {
  const [part, number, end] = field.split(".");
  if (part === "pickup") return offer.pickup_station_id;
  const {package_id: packageId} = request.packages[Number(number)];
  return end === "destination"
    && offer.packages.find(({package_id: id}) => id === packageId)?.destination_station_id;
}

const walksOf = (offer, {places = [], request}) => places.flatMap(({fields, served_by: nearest, alternatives}) => {
  const stationId = stationAt(fields[0], offer, request);
  const station = [nearest, ...alternatives].find(({station_id: id}) => id === stationId);
  return station ? [WORDS.places.uses(fields[0] === "pickup", walkText(station))] : [];
});

export const OfferNotes = ({offer, quote}) =>
  [...walksOf(offer, quote), ...(offer.tariff ? termsText(offer.tariff.payment_terms) : [])]
    .map((line) => html`<p>${line}</p>`);
