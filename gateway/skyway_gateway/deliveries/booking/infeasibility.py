"""Whether a delivery that could not be booked now may be booked in a later round."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.mission import Booking, OfferLimits
from skyway.contracts.shortlist import Candidates
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, Refusal

#: The delivery is given up after this many refusals by drones (docs/reference/booking.md).
MOST_REFUSALS: Final = 5

#: Reasons that hold for all drones of a provider.
_ANY_DRONE: Final = ("OTHER_CURRENCY",)


@dataclass(frozen=True, slots=True)
class Infeasible:
    """Why no later round can find a drone."""

    reasons: tuple[ProviderReason, ...]
    detail: str


def has_too_many_refusals(delivery: Delivery) -> bool:
    """Whether no further drone is asked; the trips of one attempt count as one refusal."""
    return len({refusal.attempt for refusal in delivery.refusals}) >= MOST_REFUSALS


def why_infeasible(
    offer: OfferLimits | None, booking: Booking, candidates: Candidates
) -> Infeasible | None:
    """Why no later round can find a drone; None while a later round may find one.

    Without candidates only the registry's reasons count. A request without any provider waits,
    because the first fleet may still register. A reason that holds for the compared drones of a
    provider may not hold for its busy drones. An accepted offer does not wait: it can be kept now,
    or it is lost.
    """
    reasons = (*booking.reasons, *candidates.infeasible)
    if offer is not None:
        return _lost(offer, reasons)
    is_busy = booking.outcome == "BUSY" and not candidates.shortlist.is_empty
    if is_busy or not reasons or any(_may_pass(reason, candidates) for reason in reasons):
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


def no_reason_given(detail: str) -> ProviderReason:
    """The reason of a delivery that is given up before any provider gave one."""
    return ProviderReason(provider_id=None, code="TOO_LATE", detail=detail, is_temporary=False)


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
    return f"{reason.provider_id}: {reason.code}, {reason.detail}"
