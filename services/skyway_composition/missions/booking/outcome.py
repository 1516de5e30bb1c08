"""The answer when no mission could be booked: BUSY for now, or INFEASIBLE for good."""

from collections.abc import Mapping
from typing import Final

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.mission import Booking, BookMissions, OfferLimits
from skyway.contracts.quote import HoldLoss, KeepOffer
from skyway_composition.planning.refusals import refused_for_all


def without_offer(
    requested: BookMissions | KeepOffer, reasons: tuple[ProviderReason, ...]
) -> Booking:
    """BUSY while a later attempt may succeed, else INFEASIBLE.

    A request for a quoted offer is INFEASIBLE: that offer is lost. Without candidates the answer
    is BUSY; the gateway decides by the registry's reasons.
    """
    if requested.offer is not None:
        return _offer_lost(requested.offer, reasons)
    may_change = requested.shortlist.is_empty or any(reason.is_temporary for reason in reasons)
    return Booking(outcome="BUSY" if may_change else "INFEASIBLE", reasons=reasons)


def pickup_unknown(requested: BookMissions | KeepOffer) -> Booking:
    """INFEASIBLE: the pickup station is in no network."""
    detail = f"pickup station {requested.request.pickup.station_id!r} is in no network"
    reasons = refused_for_all(requested.shortlist.provider_ids, "DESTINATION_UNREACHABLE", detail)
    return Booking(outcome="INFEASIBLE", reasons=tuple(reasons))


def all_taken(requested: BookMissions | KeepOffer, reasons: tuple[ProviderReason, ...]) -> Booking:
    """BUSY because others were faster in every round; a quoted offer is lost."""
    explained = {reason.provider_id for reason in reasons}
    detail = "other bookings have reserved its drones or pads"
    taken = [
        reason.model_copy(update={"is_temporary": True})
        for reason in refused_for_all(requested.shortlist.provider_ids, "TAKEN", detail)
        if reason.provider_id not in explained
    ]
    if requested.offer is not None:
        return _offer_lost(requested.offer, (*reasons, *taken))
    return Booking(outcome="BUSY", reasons=(*reasons, *taken))


def _offer_lost(offer: OfferLimits, reasons: tuple[ProviderReason, ...]) -> Booking:
    """INFEASIBLE with OFFER_LOST: a quoted offer does not wait; the reason says what is lost."""
    own = [each for each in reasons if each.provider_id == offer.provider_id]
    gone = "; ".join(f"{each.code}: {each.detail}" for each in own) or "none of its drones is free"
    promised = (
        f"{offer.price.amount} {offer.price.currency} within {offer.within_s:.0f} s cannot be kept"
    )
    reason = ProviderReason(
        provider_id=offer.provider_id,
        code="OFFER_LOST",
        detail=f"{promised}: {gone}",
        is_temporary=False,
        data={
            "price": offer.price.amount,
            "within_s": offer.within_s,
            "because": [each.code for each in own],
        },
    )
    return Booking(outcome="INFEASIBLE", reasons=(reason,))


def with_hold_loss(booking: Booking, loss: HoldLoss) -> Booking:
    """The answer; its reason OFFER_LOST says why the held drones and pads could not be used."""
    reasons = tuple(
        each.model_copy(
            update={
                "detail": f"{_LOSSES[loss]}; then {each.detail}",
                "data": {**each.data, "hold_loss": loss},
            }
        )
        if each.code == "OFFER_LOST"
        else each
        for each in booking.reasons
    )
    return booking.model_copy(update={"reasons": reasons})


_LOSSES: Final[Mapping[HoldLoss, str]] = {
    "EXPIRED": "the hold of the offer expired before the booking reached composition",
    "NETWORK_CHANGED": "the network or its closures changed while the offer was held",
    "CALENDAR_CHANGED": "its drone's calendar changed while the offer was held",
    "DRONE_NOT_FREE": "its drone is not free, or can no longer fly it",
    "REQUEST_CHANGED": "packages of the request were cancelled while the offer was held",
}
