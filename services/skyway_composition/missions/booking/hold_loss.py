"""Decides whether an offer can be booked as it is held: a pure decision."""

from collections.abc import Iterable

from skyway.contracts.quote import HoldLoss
from skyway.delivery.request import DeliveryRequest
from skyway_composition.missions.booking.held_offer import HeldOffer
from skyway_composition.missions.booking.hold_store import Hold
from skyway_composition.networks.store import Present
from skyway_composition.planning.availability import BookedMission


def held_offer(hold: Hold | None, number: int, *, now_ms: int) -> HeldOffer | None:
    """The numbered offer of a hold that has not expired; None without one."""
    if hold is None or hold.until_ms <= now_ms or number >= len(hold.offers):
        return None
    return hold.offers[number]


def hold_loss(
    held: HeldOffer | None,
    *,
    request: DeliveryRequest,
    present: Present,
    engaged: Iterable[BookedMission],
    now_ms: int,
) -> HoldLoss | None:
    """Why a held offer cannot be booked as it was planned; None if it can.

    `engaged` are the present calendars of its drones, `now_ms` is fleet time.
    """
    if held is None or held.starts_ms < now_ms:
        return "EXPIRED"
    if held.present != present:
        return "NETWORK_CHANGED"
    if held.package_ids != {each.package_id for each in request.packages}:
        return "REQUEST_CHANGED"
    engaged = frozenset(engaged)
    if engaged == frozenset(held.calendars):
        return None
    is_occupied = any(each.mission_id is None for each in engaged)
    return "DRONE_NOT_FREE" if is_occupied else "CALENDAR_CHANGED"
