// What the page says first: the next moment of the delivery, by when, and what happens now.

import {clockTime, spanText} from "./moments.js";
import {awaited} from "./proofs.js";
import {WORDS} from "./words.js";

// A drone this near, in seconds of fleet time, is about to land.
const ARRIVING_S = 60;
// A delivery that is later than expected by so much, in seconds of fleet time, is overdue.
const OVERDUE_S = 120;
// What is farther away has a time of day instead of a countdown, seconds.
const COUNTED_S = 6 * 3_600;
const LATE_MS = 60_000;

const byTime = (name) => (one, other) => Date.parse(one[name]) - Date.parse(other[name]);

// The next package that is still to come.
const nextOf = ({packages}) => packages.filter(({delivered_at, eta_at}) => !delivered_at && eta_at)
  .sort(byTime("eta_at"))[0];
const toCome = ({packages}) => packages.filter(({delivered_at, eta_at}) => !delivered_at && eta_at).length
  + packages.filter(({delivered_at: at}) => at).length;

export const isLate = ({eta_at: eta, due_at: due}) => Boolean(due) && Date.parse(eta) - Date.parse(due) > LATE_MS;

// Each answer: {headline, promise, detail, isLate}. `nameOf` names stations.
export function said(state, now, nameOf) {
  if (state.is_over) return ofEnd(state, now);
  const next = nextOf(state);
  if (state.stage === "REQUESTED" || next === undefined) return ofWaiting(state, now);
  const waiting = awaited(state);
  if (waiting) {
    const until = clockTime(waiting.proof_until_at, now);
    return {headline: WORDS.isHere, promise: "", detail: WORDS.waitsUntil(nameOf(waiting.station_id), until)};
  }
  const onTheWay = state.stage === "ON_THE_WAY" ? WORDS.stages.ON_THE_WAY : WORDS.stages.PLANNED;
  if (state.is_replanning) return {headline: onTheWay, promise: "", detail: WORDS.replanning};
  const leftS = (Date.parse(next.eta_at) - now) / 1_000;
  if (leftS < -OVERDUE_S) {
    return {headline: onTheWay, promise: "", detail: WORDS.overdue(clockTime(next.eta_at, now)), isLate: true};
  }
  return {
    headline: landing(state, next, leftS, now),
    promise: promiseOf(next, now),
    detail: doingNow(state, next, now, nameOf),
    isLate: isLate(next),
  };
}

function landing(state, next, leftS, now) {
  const count = toCome(state);
  if (state.stage === "ON_THE_WAY" && leftS <= ARRIVING_S) return WORDS.landsNow(count);
  if (leftS > COUNTED_S) return WORDS.landsAt(clockTime(next.eta_at, now), count);
  return WORDS.landsIn(spanText(leftS), count);
}

function promiseOf(next, now) {
  const base = next.is_p90 ? WORDS.likely(clockTime(next.eta_until_at, now))
    : WORDS.expected(clockTime(next.eta_at, now));
  return isLate(next) ? `${base}, ${WORDS.late(clockTime(next.due_at, now))}` : base;
}

function doingNow(state, next, now, nameOf) {
  const moment = clockTime(next.eta_at, now);
  const lines = next.is_p90 && moment !== clockTime(next.eta_until_at, now) ? [WORDS.isExpected(moment)] : [];
  if (state.stage === "LOADING") lines.push(WORDS.loading);
  else if (state.stage === "ON_THE_WAY") lines.push(WORDS.doing[state.activity]?.(nameOf(next.station_id)) ?? "");
  else if (state.other_pickup_id) lines.push(WORDS.otherPickup(nameOf(state.other_pickup_id)));
  else if (state.loaded_at) {
    const pickup = state.places.find(({role}) => role === "PICKUP");
    if (pickup) lines.push(WORDS.loadsAt(nameOf(pickup.station_id), clockTime(state.loaded_at, now)));
  }
  if (state.is_shared) lines.push(WORDS.shared);
  return lines.filter(Boolean).join(" ");
}

function ofWaiting(state, now) {
  const answer = (headline, detail) => ({headline, promise: "", detail});
  if (state.state === "SCHEDULED") return answer(WORDS.requested, WORDS.scheduled);
  if (!state.is_waiting || !state.drone_free_at) {
    return state.is_waiting ? answer(WORDS.waiting, WORDS.busyUnknown) : answer(WORDS.requested, WORDS.looking);
  }
  const leftS = (Date.parse(state.drone_free_at) - now) / 1_000;
  return answer(WORDS.waiting, leftS > 0 ? WORDS.busy(spanText(leftS)) : WORDS.busyUnknown);
}

function ofEnd({stage, state, packages}, now) {
  const last = packages.filter(({delivered_at: at}) => at).sort(byTime("delivered_at")).at(-1);
  if (stage === "DELIVERED") {
    const headline = last ? WORDS.deliveredAt(clockTime(last.delivered_at, now)) : WORDS.stages.DELIVERED;
    const earlyS = last?.due_at ? (Date.parse(last.due_at) - Date.parse(last.delivered_at)) / 1_000 : 0;
    return {headline, promise: earlyS >= 60 ? WORDS.earlier(spanText(earlyS)) : WORDS.enjoy, detail: ""};
  }
  if (stage === "PARTLY_DELIVERED") return {headline: WORDS.partly, promise: "", detail: WORDS.ended};
  const isCancelled = state === "CANCELLED";
  return {
    headline: isCancelled ? WORDS.cancelled : WORDS.failed,
    promise: "",
    detail: isCancelled ? WORDS.cancelledDetail : WORDS.ended,
  };
}
