// The cards of the packages: where each comes down, how to get there, and how its delivery ended.

import {line, made} from "./elements.js";
import {clockTime} from "./moments.js";
import {isLate} from "./said.js";
import {locate, mayAsk, standsAt, walkText} from "./walk.js";
import {WORDS, placeText} from "./words.js";

// What is shown: unchanged cards stay, because somebody may be at a button or a link.
let shown = "";

// `changed` is called when what is known of the reader's place changes.
export function showPackages(section, state, {nameOf, now, changed}) {
  const {packages, places, station_names: names} = state;
  const key = JSON.stringify([packages, places, names, standsAt()]);
  if (key === shown) return;
  shown = key;
  section.replaceChildren(...packages.map((one) => made("article", {},
    made("h2", {textContent: WORDS.to(one.package_id, nameOf(one.station_id))}),
    ...lines(one, places, {nameOf, now, changed, isOnly: packages.length === 1}))));
}

function lines(one, places, {nameOf, now, changed, isOnly}) {
  if (one.delivered_at) return handedOver(one, nameOf, now);
  if (one.state in WORDS.ends) {
    const why = one.code ? [line(WORDS.reasons[one.code] ?? WORDS.otherReason)] : [];
    return [line(WORDS.ends[one.state], "bad"), ...why];
  }
  // The head of the page says when the only package comes.
  const time = one.eta_at && !isOnly ? [line(timeText(one, now), isLate(one) ? "late" : "")] : [];
  const absent = line(WORDS.absent(nameOf(one.alternative_id)), "place");
  return [...time, ...padLines(one, places, {nameOf, changed}), absent];
}

function timeText(one, now) {
  const expected = WORDS.expected(clockTime(one.eta_at, now));
  return isLate(one) ? `${expected}, ${WORDS.late(clockTime(one.due_at, now))}` : expected;
}

// With what the drone measured.
function handedOver(one, nameOf, now) {
  const {proof_mass_kg: massKg, proof_position: position} = one;
  const where = nameOf(one.proof_station_id ?? one.station_id);
  return [
    line(WORDS.handedOver(where, clockTime(one.delivered_at, now)), "done"),
    ...(typeof massKg === "number" ? [line(WORDS.mass(Number(massKg.toFixed(3))))] : []),
    ...(position ? [line(WORDS.place(placeText(position)))] : []),
  ];
}

// The pad where a package comes down. The page does not know where its recipient lives.
function padLines({station_id: stationId}, places, {nameOf, changed}) {
  const position = places.find((each) => each.station_id === stationId)?.position;
  if (!position) return [];
  const [longitude, latitude] = position;
  const link = made("a", {href: `geo:${latitude},${longitude}`, textContent: WORDS.openMap, className: "way"});
  const walk = walkText(position);
  const ask = made("button", {type: "button", textContent: WORDS.howFar, className: "quiet"});
  ask.addEventListener("click", () => locate(changed));
  return [
    line(WORDS.pad(nameOf(stationId))),
    line(placeText(position), "place"),
    ...(walk ? [line(walk, "walk")] : []),
    made("div", {className: "ways"}, link, ...(mayAsk() ? [ask] : [])),
  ];
}
