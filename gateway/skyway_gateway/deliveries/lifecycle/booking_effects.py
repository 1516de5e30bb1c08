"""What changes when missions are booked, when booking gives up, and when packages are cancelled."""

from collections.abc import Collection, Sequence
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.delivery_event import DeliveryEventType
from skyway.contracts.delivery_event_data import Custodian
from skyway.contracts.mission import Cancellation, Mission
from skyway.delivery.request import DeliveryRequest
from skyway.ids import PackageId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway_gateway.deliveries.lifecycle import event_data
from skyway_gateway.deliveries.lifecycle.charges import with_charges
from skyway_gateway.deliveries.lifecycle.delivery import (
    Delivery,
    Flags,
    PackageStatus,
)
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission
from skyway_gateway.deliveries.lifecycle.progress import (
    CANCELLED_CODE,
    Progress,
    can_turn_back,
    changed,
    settled,
    with_cancelled,
    with_flags,
    with_packages,
    with_returning,
)
from skyway_gateway.lateness.lateness_forecast import due_of, p90_of
from skyway_gateway.notifications.delivery_events import Happening

#: The code of a package that no mission could be booked for.
NOT_PLANNED_CODE: Final = "NOT_PLANNED"

#: How long a request without a deadline waits, fleet and wall seconds (docs/reference/time.md).
_BUSY_FLEET_S: Final = 3600.0
_BUSY_WALL_S: Final = 60.0


def give_up_at(request: DeliveryRequest, clock: FleetClock) -> datetime:
    """The first limit of the request; without one, an hour after now or the earliest pickup.

    The hour is fleet time, and at least a minute of wall time.
    """
    if request.latest_at is not None:
        return request.latest_at
    now = clock.now()
    margin = fleet_margin(clock, fleet_s=_BUSY_FLEET_S, wall_s=_BUSY_WALL_S)
    return max(now, request.first_hand_over_at or now) + margin


def give_up_again_at(delivery: Delivery, clock: FleetClock) -> datetime:
    """The same for a delivery that waits again, for example because its drone has refused it."""
    update = {"earliest_pickup_at": loaded_after(delivery)}
    return give_up_at(delivery.request.model_copy(update=update), clock)


def loaded_after(delivery: Delivery) -> datetime | None:
    """The moment before which no drone loads; None without one.

    A delivery that was booked from another station than it asked for keeps the moment of its first
    booking: its customer may be on the way.
    """
    booked_at = [each.pickup_at for each in delivery.refusals if each.pickup_at is not None]
    moments = [*booked_at[:1], *filter(None, [delivery.request.earliest_pickup_at])]
    return max(moments, default=None)


def after_booking(
    delivery: Delivery,
    missions: Sequence[Mission],
    *,
    at: datetime,
    late_share: float | None = None,
) -> Progress:
    """The delivery with its new missions: their ETAs are promised to the customer.

    The custodian of a package is now the station where its mission is loaded. Packages that no
    mission carries wait for the next attempt. `late_share` is the lateness that nine of ten
    packages do not exceed, as a share of the planned time; None if it is not known. Lateness counts
    from the P90 of a package, unless the customer asked for P50 or no P90 is known.
    """
    # Each mission starts as BOOKED, however far it has come: its reports follow in order.
    booked = [_flown(mission) for mission in missions]
    carried = {eta.package_id: (mission, eta) for mission in booked for eta in mission.packages}

    def promise(package: PackageStatus) -> dict[str, object]:
        mission, eta = carried[package.package_id]
        p90_at = p90_of(eta.eta_at, start_at=mission.booked_start_at, share=late_share)
        return {
            "mission_id": mission.mission_id,
            "custodian": Custodian(kind="STATION", id=mission.pickup_station_id),
            "promised_at": eta.eta_at,
            "promised_p90_at": p90_at,
            "due_at": due_of(eta.package_id, eta.eta_at, p90_at, delivery.request),
            "eta_at": eta.eta_at,
        }

    planned = with_packages(
        changed(delivery, missions=(*delivery.missions, *booked), reasons=(), updated_at=at),
        promise,
        where=lambda package: package.is_waiting and package.package_id in carried,
    )
    is_first = delivery.state == "REQUESTED"
    planned = with_flags(
        changed(
            planned,
            state="PLANNED" if is_first else delivery.state,
            flags=Flags() if is_first else delivery.flags,
            attempt=delivery.attempt + bool(planned.waiting_packages),
            price=event_data.price_of(planned.missions),
            provider_id=planned.missions[0].provider_id,
        )
    )
    data = event_data.planned(planned, booked, attempt=delivery.attempt)
    return Progress(planned, (Happening(DeliveryEventType.PLANNED, at, data),))


def cancelled_meanwhile(delivery: Delivery, missions: Sequence[Mission]) -> tuple[PackageId, ...]:
    """The packages that these missions carry although the customer has cancelled them meanwhile."""
    carried = {eta.package_id for mission in missions for eta in mission.packages}
    return tuple(
        package.package_id
        for package in delivery.packages
        if package.state == "CANCELLED" and package.package_id in carried
    )


def after_giving_up(
    delivery: Delivery, reasons: Sequence[ProviderReason], *, detail: str, at: datetime
) -> Progress:
    """The delivery without its waiting packages; REJECTED if it never had a mission."""
    left = with_cancelled(
        changed(delivery, reasons=tuple(reasons), updated_at=at),
        where=lambda package: package.is_waiting,
        code=NOT_PLANNED_CODE,
        detail=detail,
        at=at,
    )
    if delivery.state == "REQUESTED":
        rejected = changed(left.delivery, state="REJECTED", flags=Flags())
        data = event_data.rejected(reasons, detail)
        return Progress(rejected, (Happening(DeliveryEventType.REJECTED, at, data),))
    left = Progress(with_flags(left.delivery), left.happenings)
    return settled(left, at=at, code=NOT_PLANNED_CODE, detail=detail)


def _flown(mission: Mission) -> FlownMission:
    return FlownMission.model_validate(
        {**dict(mission), "state": "BOOKED", "booked_start_at": mission.start_at}
    )


def is_cancelled(package: PackageStatus) -> bool:
    """Whether the package is cancelled, or on its way back because of a cancellation."""
    is_too_late = package.state in ("DELIVERED", "STRANDED")
    return package.code == CANCELLED_CODE and not is_too_late


def can_be_cancelled(package: PackageStatus) -> bool:
    """Whether the package can still be kept from its recipient."""
    return can_turn_back(package) and not is_cancelled(package)


def after_cancellation(
    delivery: Delivery,
    requested: Collection[PackageId],
    done: Cancellation,
    *,
    reason: str,
    at: datetime,
    host_delay: timedelta,
) -> Progress:
    """The delivery after the requested packages were cancelled, as far as that was possible.

    `done` is what composition has stopped. Later mission reports repeat it and change nothing.
    `host_delay` is the lateness of packages that does not count.
    """

    def stays(package: PackageStatus) -> bool:
        is_loose = package.is_waiting or package.package_id in done.released
        return package.package_id in requested and package.state == "CREATED" and is_loose

    without = with_cancelled(
        changed(delivery, updated_at=max(at, delivery.updated_at)),
        where=stays,
        code=CANCELLED_CODE,
        detail=reason,
        at=at,
    )
    returning = with_returning(without.delivery, done.returning, code=CANCELLED_CODE, detail=reason)
    progress = Progress(with_flags(returning), without.happenings)
    progress = with_charges(progress, host_delay=host_delay)
    return settled(progress, at=at, code=CANCELLED_CODE, detail=reason)
