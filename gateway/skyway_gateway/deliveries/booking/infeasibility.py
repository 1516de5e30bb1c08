"""Busy or never: what a round of booking without a mission means for the delivery."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.mission import Booking, OfferLimits
from skyway.contracts.shortlist import Candidates
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, Refusal

#: So often may drones refuse a delivery before it is given up (docs/reference/booking.md).
MOST_REFUSALS: Final = 5

#: What holds for every drone of a provider, or for none.
_WHOEVER_FLIES: Final = ("OTHER_CURRENCY",)


@dataclass(frozen=True, slots=True)
class Never:
    """Why no later round can find a drone."""

    reasons: tuple[ProviderReason, ...]
    detail: str


def most_refused(delivery: Delivery) -> bool:
    """Whether no further drone is asked; the trips of one attempt count once."""
    return len({refusal.attempt for refusal in delivery.refusals}) >= MOST_REFUSALS


def why_never(offer: OfferLimits | None, booking: Booking, candidates: Candidates) -> Never | None:
    """Why no later round can find a drone; None while one may.

    Without candidates composition knows nothing, and only the registry's reasons count. Nobody
    registered is no reason for ever: the first fleet may be on its way. What holds for the drones
    of a provider that were compared may not hold for those that are busy now. A taken offer does
    not wait: what it promised is there at once, or lost.
    """
    reasons = (*booking.reasons, *candidates.infeasible)
    if offer is not None:
        return _lost(offer, reasons)
    is_busy = booking.outcome == "BUSY" and not candidates.shortlist.is_empty
    if is_busy or not reasons or any(_may_pass(reason, candidates) for reason in reasons):
        return None
    detail = "no provider can fly it: " + "; ".join(_in_words(reason) for reason in reasons)
    return Never(reasons, detail)


def refusal_reasons(refusals: Iterable[Refusal]) -> tuple[ProviderReason, ...]:
    """Drones' refusals in the form of reasons."""
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


def nobody_asked(detail: str) -> ProviderReason:
    """The reason of a delivery that ran out of time before any provider said a word."""
    return ProviderReason(provider_id=None, code="TOO_LATE", detail=detail, is_temporary=False)


def _may_pass(reason: ProviderReason, candidates: Candidates) -> bool:
    if reason.code in _WHOEVER_FLIES:
        return False
    return reason.is_temporary or reason.provider_id in candidates.more_later


def _lost(offer: OfferLimits, reasons: tuple[ProviderReason, ...]) -> Never:
    detail = "what the offer promised is not to be had any more"
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
    return Never(reasons, detail)


def _in_words(reason: ProviderReason) -> str:
    return f"{reason.provider_id}: {reason.code}, {reason.detail}"
