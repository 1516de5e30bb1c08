"""One round of booking: what it asks for, whether a later round can help, how fast rounds end."""

import math
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import datetime
from statistics import fmean
from time import perf_counter
from typing import Final

from skyway.contracts.candidate import CandidateQuery, ProviderReason, ProviderReasonCode
from skyway.contracts.mission import Booking, BookMissions, Mission, OfferLimits
from skyway.contracts.mission_reports import CALENDAR_CODES
from skyway.contracts.shortlist import Candidates, Shortlist
from skyway.delivery.offer import Price
from skyway.delivery.qos import ProviderChoice
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DroneId
from skyway.runtime.errors import ServiceUnavailable
from skyway_gateway.deliveries.lifecycle.booking_effects import loaded_after
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.delivery_parts import Refusal
from skyway_gateway.deliveries.records.delivery_rows import QueuedDelivery
from skyway_gateway.quotes.check_request import NO_PROVIDER

#: The delivery is given up after this many refusals by drones (docs/reference/booking.md).
MOST_REFUSALS: Final = 5

#: The delivery is given up after this many attempts that lost their place in a drone's calendar,
#: so that no delivery is booked for ever without being flown. Our own choice.
MOST_LOST_PLACES: Final = 20

#: How many of the last rounds say how fast rounds end.
_MEASURED_ROUNDS: Final = 32

#: After so many seconds of work without a pause, the pace of rounds shows what is possible.
_PACE_KNOWN_S: Final = 3.0

#: Reasons that hold for all drones of a provider.
_ANY_DRONE: Final = ("OTHER_CURRENCY",)


def candidate_query(queued: QueuedDelivery) -> CandidateQuery:
    """The question to the registry; for an accepted offer only its provider is asked."""
    delivery = queued.delivery
    choice = delivery.request.qos.providers
    if delivery.offer is not None:
        choice = ProviderChoice(pinned=delivery.offer.provider_id)
    return CandidateQuery.of(
        _request(delivery),
        queued.pickup_position,
        providers=choice,
        excluded_drone_ids=drones_that_refused(delivery.refusals),
    )


def booking_request(delivery: Delivery, shortlist: Shortlist) -> BookMissions:
    """The question to composition; an accepted offer is booked by the tariff of its quote."""
    offer = delivery.offer
    if offer is not None:
        shortlist = shortlist.with_tariff(offer.provider_id, offer.tariff)
    return BookMissions(
        attempt=delivery.attempt,
        request=_request(delivery),
        shortlist=shortlist,
        offer=_limits(delivery),
        asked_at=delivery.created_at,
        ready_at=delivery.request.earliest_pickup_at,
    )


def _request(delivery: Delivery) -> DeliveryRequest:
    """The request with only the packages that wait, and the remaining price limit.

    A request with `pooling_wait_s` begins after this wait. A delivery that was booked before keeps
    its pickup.
    """
    waiting = {package.package_id for package in delivery.waiting_packages}
    request = delivery.request
    packages = tuple(one for one in request.packages if one.package_id in waiting)
    qos = request.qos
    if qos.max_price is not None:
        max_price = max(0, qos.max_price - _booked_amount(delivery))
        qos = qos.model_copy(update={"max_price": max_price})
    update = {
        "pickup": delivery.pickup,
        "packages": packages,
        "qos": qos,
        "earliest_pickup_at": loaded_after(delivery),
    }
    left = request.model_copy(update=update)
    return left.begun_after_wait(delivery.created_at)


def _limits(delivery: Delivery) -> OfferLimits | None:
    """The limits of an accepted offer, less the price of trips that are booked already."""
    offer = delivery.offer
    if offer is None:
        return None
    amount = max(0, offer.price.amount - _booked_amount(delivery))
    price = Price(amount=amount, currency=offer.price.currency)
    return offer.model_copy(update={"price": price})


def _booked_amount(delivery: Delivery) -> int:
    """The price of the booked missions, without those that were cancelled."""
    booked = (mission for mission in delivery.missions if mission.state != "CANCELLED")
    return sum(mission.price.amount for mission in booked)


class RoundPace:
    """How many rounds of booking end a second, of at most `most` at the same time."""

    def __init__(self, most: int, *, now_s: Callable[[], float] = perf_counter) -> None:
        self._most = most
        self._now_s = now_s
        self._under_way = 0
        self._busy_since_s = 0.0
        #: Seconds in which rounds were under way, before `_busy_since_s`.
        self._busy_s = 0.0
        self._took_s = deque[float](maxlen=_MEASURED_ROUNDS)
        #: After how many busy seconds each of the last rounds has ended.
        self._ended_s = deque[float](maxlen=_MEASURED_ROUNDS)

    def begin(self) -> float:
        """Note that a round begins; the value is for `end`."""
        now_s = self._now_s()
        if not self._under_way:
            self._busy_since_s = now_s
        self._under_way += 1
        return now_s

    def end(self, begun_s: float | None) -> None:
        """Note that a round ends; None for one that has asked nobody, and says nothing."""
        now_s = self._now_s()
        if begun_s is not None:
            self._took_s.append(now_s - begun_s)
            self._ended_s.append(self._busy_s + now_s - self._busy_since_s)
        self._under_way -= 1
        if not self._under_way:
            self._busy_s += now_s - self._busy_since_s

    def per_s(self) -> float:
        """The pace of the last rounds, counted while any was under way; infinite before the first.

        After a pause that pace says how few were asked for, not how many are possible. So in the
        first seconds all places count as taken by rounds that take as long as the last ones.
        """
        if not self._took_s:
            return math.inf
        busy_s = self._now_s() - self._busy_since_s if self._under_way else 0.0
        if busy_s > _PACE_KNOWN_S:
            return len(self._ended_s) / (self._busy_s + busy_s - self._ended_s[0])
        return self._most / max(fmean(self._took_s), 1e-6)


class AnswerLost(ServiceUnavailable):
    """Composition was asked to book at `asked_at`, wall time, and has not answered."""

    def __init__(self, trouble: ServiceUnavailable, asked_at: datetime) -> None:
        super().__init__(trouble.service, trouble.detail, code=trouble.code)
        self.asked_at = asked_at


def are_live(delivery: Delivery, missions: Iterable[Mission]) -> bool:
    """Whether all these missions fly other packages of the delivery now."""
    live = {mission.mission_id for mission in delivery.live_missions}
    return all(mission.mission_id in live for mission in missions)


@dataclass(frozen=True, slots=True)
class Infeasible:
    """Why no later round can find a drone."""

    reasons: tuple[ProviderReason, ...]
    detail: str


def drones_that_refused(refusals: Iterable[Refusal]) -> tuple[DroneId, ...]:
    """The drones that are not asked again; a changed calendar is no refusal by its drone."""
    return tuple(each.drone_id for each in refusals if _is_by_drone(each))


def has_too_many_refusals(refusals: Iterable[Refusal]) -> bool:
    """Whether no further drone is asked; the trips of one attempt count as one refusal."""
    refusals = tuple(refusals)
    refused = {each.attempt for each in refusals if _is_by_drone(each)}
    lost = {each.attempt for each in refusals} - refused
    return len(refused) >= MOST_REFUSALS or len(lost) >= MOST_LOST_PLACES


def _is_by_drone(refusal: Refusal) -> bool:
    """Whether the drone itself has refused, or did not answer; else its calendar has changed."""
    return refusal.code not in CALENDAR_CODES


def why_infeasible(
    offer: OfferLimits | None, booking: Booking, candidates: Candidates
) -> Infeasible | None:
    """Why no later round can find a drone; None while a later round may find one.

    Without candidates only the registry's reasons count. While no provider has a drone, a request
    waits, because the first fleet may still register. A reason that holds for the compared drones
    of a provider may not hold for its busy drones. An accepted offer does not wait: it can be kept
    now, or it is lost.
    """
    reasons = (*booking.reasons, *candidates.infeasible)
    if offer is not None:
        return _lost(offer, reasons)
    is_busy = booking.outcome == "BUSY" and not candidates.shortlist.is_empty
    of_fleets = [reason for reason in reasons if reason.code != "NO_DRONES"]
    if is_busy or not of_fleets or any(_may_pass(reason, candidates) for reason in of_fleets):
        return None
    detail = "no provider can fly it: " + "; ".join(_in_words(reason) for reason in reasons)
    return Infeasible(reasons, detail)


def refusal_reasons(refusals: Iterable[Refusal]) -> tuple[ProviderReason, ...]:
    """The refusals of drones as reasons."""
    return tuple(
        ProviderReason(
            provider_id=refusal.provider_id,
            code="REFUSED",
            detail=f"drone {refusal.drone_id} refused: {refusal.code}, {refusal.detail}",
            is_temporary=False,
            data={"drone_id": refusal.drone_id, "attempt": refusal.attempt},
        )
        for refusal in refusals
    )


def reasons_of_round(booking: Booking, candidates: Candidates) -> tuple[ProviderReason, ...]:
    """Why a round of booking found no drone; NO_PROVIDER when no provider gave a reason."""
    reasons = (*booking.reasons, *candidates.infeasible)
    return reasons if reasons or not candidates.shortlist.is_empty else (NO_PROVIDER,)


def no_reason_given(request: DeliveryRequest, detail: str) -> ProviderReason:
    """The reason of a delivery that is given up before any provider gave one.

    It is TOO_LATE only if the customer has set a deadline or the end of a window.
    """
    code: ProviderReasonCode = "NO_PROVIDER" if request.latest_at is None else "TOO_LATE"
    return ProviderReason(provider_id=None, code=code, detail=detail, is_temporary=False)


def not_in_time(give_up_at: datetime, reasons: Iterable[ProviderReason]) -> str:
    """Why a delivery is given up at the end of its waiting time, in words."""
    detail = f"no drone could be booked before {give_up_at:%Y-%m-%dT%H:%M:%SZ}"
    return "; ".join((detail, *(_in_words(reason) for reason in reasons)))


def _may_pass(reason: ProviderReason, candidates: Candidates) -> bool:
    if reason.code in _ANY_DRONE:
        return False
    return reason.is_temporary or reason.provider_id in candidates.more_later


def _lost(offer: OfferLimits, reasons: tuple[ProviderReason, ...]) -> Infeasible:
    detail = "the promise of the offer can no longer be kept"
    if reasons:
        detail += ": " + "; ".join(_in_words(reason) for reason in reasons)
    if not any(reason.code == "OFFER_LOST" for reason in reasons):
        lost = ProviderReason(
            provider_id=offer.provider_id,
            code="OFFER_LOST",
            detail=detail,
            is_temporary=False,
            data=offer.model_dump(mode="json"),
        )
        reasons = (lost, *reasons)
    return Infeasible(reasons, detail)


def _in_words(reason: ProviderReason) -> str:
    who = "" if reason.provider_id is None else f"{reason.provider_id}: "
    return f"{who}{reason.code}, {reason.detail}"
