"""Busy or never: what a round of booking without a mission means for the delivery."""

from collections.abc import Iterable
from typing import Final

from skyway.contracts.candidate import Candidates, ProviderReason
from skyway.contracts.mission import Booking
from skyway_gateway.deliveries.delivery import Delivery, Refusal

#: So many drones may refuse a delivery before it is rejected (decisions.md, Booking).
MOST_REFUSALS: Final = 5


def most_refused(delivery: Delivery) -> bool:
    """Whether no further drone is asked."""
    return len(delivery.refusals) >= MOST_REFUSALS


def why_never(booking: Booking, candidates: Candidates) -> str | None:
    """Why no later round can find a drone; None while one may.

    Without candidates composition knows nothing, and only the registry's reasons count. Nobody
    registered is no reason for ever: the first fleet may be on its way.
    """
    reasons = (*booking.reasons, *candidates.infeasible)
    is_busy = booking.outcome == "BUSY" and bool(candidates.candidates)
    if is_busy or not reasons or any(reason.is_temporary for reason in reasons):
        return None
    return "no provider can fly it: " + "; ".join(_in_words(reason) for reason in reasons)


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


def _in_words(reason: ProviderReason) -> str:
    return f"{reason.provider_id}: {reason.code}, {reason.detail}"
