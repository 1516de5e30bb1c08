"""What a booking, a rejection or a mission report does to a delivery, and what is told of it.

Pure: a delivery and what happened in, the delivery afterwards and what to tell out. Reports come
once each and in order (`follow` sees to that).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.delivery_event import DeliveryEventType
from skyway.contracts.mission import LIVE_MISSION_STATES, Mission, MissionReport
from skyway_gateway.deliveries import told
from skyway_gateway.deliveries.delivery import (
    Custodian,
    Delivery,
    Flags,
    PackageStatus,
    Refusal,
)
from skyway_gateway.deliveries.lateness import with_etas
from skyway_gateway.deliveries.states import DeliveryState
from skyway_gateway.notifications.events import Happening

#: A package in these states is on a drone.
_ON_BOARD: Final = ("LOADED", "IN_TRANSIT")


@dataclass(frozen=True, slots=True)
class Progress:
    """A delivery after something happened, and what to tell of it, in order."""

    delivery: Delivery
    happenings: tuple[Happening, ...] = ()


def after_report(delivery: Delivery, report: MissionReport) -> Progress:
    """The delivery after a report about one of its missions."""
    known = [one for one in delivery.missions if one.mission_id == report.mission_id]
    if not known:  # a mission of an earlier attempt: the delivery has gone on without it
        return Progress(delivery)
    mission = (report.mission or known[0]).model_copy(update={"state": report.mission_state})
    delivery = _changed(
        delivery,
        updated_at=report.at,
        missions=tuple(
            mission if one.mission_id == mission.mission_id else one for one in delivery.missions
        ),
    )
    if delivery.is_over:  # the drone's way home is no longer the customer's
        return Progress(delivery)
    progress = _BY_KIND[report.kind](delivery, mission, report)
    if progress.delivery.is_over or progress.delivery.state == "REQUESTED":
        return progress
    delivery, late = with_etas(progress.delivery, mission, report)
    return Progress(delivery, progress.happenings + late)


def after_booking(delivery: Delivery, missions: Sequence[Mission], *, at: datetime) -> Progress:
    """The delivery once missions are booked for it: what they promise now is what is promised."""
    # However far they have come by now: their reports, from the first on, will tell it in order.
    missions = [mission.model_copy(update={"state": "BOOKED"}) for mission in missions]
    promised = {eta.package_id: eta.eta_at for mission in missions for eta in mission.packages}
    packages = tuple(
        _with(
            package,
            promised_at=promised.get(package.package_id),
            eta_at=promised.get(package.package_id),
        )
        for package in delivery.packages
    )
    planned = _changed(
        delivery,
        state="PLANNED",
        updated_at=at,
        flags=Flags(),
        missions=tuple(missions),
        packages=packages,
        price=told.price_of(missions),
        provider_id=missions[0].provider_id,
        reasons=(),
    )
    return Progress(planned, (Happening(DeliveryEventType.PLANNED, at, told.planned(planned)),))


def after_rejection(
    delivery: Delivery, reasons: Sequence[ProviderReason], *, detail: str, at: datetime
) -> Progress:
    """The delivery once nobody will fly it: its packages never left the pickup."""
    rejected = _changed(
        delivery,
        state="REJECTED",
        updated_at=at,
        flags=Flags(),
        packages=tuple(_with(package, state="CANCELLED") for package in delivery.packages),
        reasons=tuple(reasons),
    )
    data = told.rejected(reasons, detail)
    return Progress(rejected, (Happening(DeliveryEventType.REJECTED, at, data),))


def _accepted(delivery: Delivery, mission: Mission, report: MissionReport) -> Progress:
    if delivery.state != "PLANNED":
        return Progress(delivery)
    news = Happening(DeliveryEventType.DISPATCHED, report.at, told.flown_by(mission))
    return Progress(_changed(delivery, state="DISPATCHED"), (news,))


def _refused(delivery: Delivery, mission: Mission, report: MissionReport) -> Progress:
    """Back to the queue: `book` asks anew, without this drone."""
    if delivery.state not in ("PLANNED", "DISPATCHED"):
        return _ended(delivery, mission, report)
    refusal = Refusal(
        attempt=report.attempt,
        provider_id=mission.provider_id,
        drone_id=mission.drone_id,
        code=report.code,
        detail=report.detail,
    )
    waiting = tuple(_with(one, promised_at=None, eta_at=None) for one in delivery.packages)
    requeued = _changed(
        delivery,
        state="REQUESTED",
        attempt=delivery.attempt + 1,
        flags=Flags(replanning=True),
        packages=waiting,
        refusals=(*delivery.refusals, refusal),
    )
    return Progress(requeued)


def _loading(delivery: Delivery, _mission: Mission, _report: MissionReport) -> Progress:
    has_begun = delivery.state in ("PLANNED", "DISPATCHED")
    return Progress(_changed(delivery, state="LOADING") if has_begun else delivery)


def _loaded(delivery: Delivery, mission: Mission, report: MissionReport) -> Progress:
    loaded = report.package_ids or tuple(package.package_id for package in mission.packages)
    drone = Custodian(kind="DRONE", id=mission.drone_id)
    packages = tuple(
        _with(one, state="LOADED", custodian=drone)
        if one.package_id in loaded and one.state == "CREATED"
        else one
        for one in delivery.packages
    )
    news = [Happening(DeliveryEventType.LOADED, report.at, told.loaded(loaded, mission, report))]
    if delivery.state != "IN_PROGRESS":
        news.append(Happening(DeliveryEventType.STARTED, report.at, told.flown_by(mission)))
    changed = _changed(delivery, state="IN_PROGRESS", activity=report.activity, packages=packages)
    return Progress(changed, tuple(news))


def _activity(delivery: Delivery, _mission: Mission, report: MissionReport) -> Progress:
    if delivery.state != "IN_PROGRESS":
        return Progress(delivery)
    packages = delivery.packages
    if report.activity == "FLYING":
        packages = tuple(
            _with(one, state="IN_TRANSIT") if one.state == "LOADED" else one for one in packages
        )
    activity = report.activity or delivery.activity
    return Progress(_changed(delivery, activity=activity, packages=packages))


def _delivered(delivery: Delivery, mission: Mission, report: MissionReport) -> Progress:
    news, packages = [], []
    for package in delivery.packages:
        if package.package_id in report.package_ids and package.state != "DELIVERED":
            packages.append(_handed_over(package, report))
            data = told.package_delivered(packages[-1], mission, report)
            news.append(Happening(DeliveryEventType.PACKAGE_DELIVERED, report.at, data))
        else:
            packages.append(package)
    changed = _changed(delivery, packages=tuple(packages))
    if any(package.state != "DELIVERED" for package in packages):
        return Progress(changed, tuple(news))
    done = _changed(changed, state="COMPLETED", activity=None, flags=Flags())
    news.append(Happening(DeliveryEventType.COMPLETED, report.at, told.completed(done)))
    return Progress(done, tuple(news))


def _replanned(delivery: Delivery, mission: Mission, report: MissionReport) -> Progress:
    data = told.replanned(mission, report)
    return Progress(delivery, (Happening(DeliveryEventType.REPLANNED, report.at, data),))


def _ended(delivery: Delivery, mission: Mission, report: MissionReport) -> Progress:
    """The mission is over before everything was delivered."""
    news, packages = [], []
    for package in delivery.packages:
        is_named = package.package_id in report.stranded_package_ids
        if package.state in _ON_BOARD or (is_named and package.state == "CREATED"):
            packages.append(_stranded(package, report))
            data = told.package_stranded(packages[-1], report)
            news.append(Happening(DeliveryEventType.PACKAGE_STRANDED, report.at, data))
        elif package.state == "CREATED" and _carries(mission, package):
            packages.append(_with(package, state="CANCELLED", eta_at=None))
        else:
            packages.append(package)
    changed = _changed(delivery, packages=tuple(packages))
    if any(one.state in LIVE_MISSION_STATES for one in changed.missions):
        return Progress(changed, tuple(news))
    end = _changed(changed, state=_end(changed, report), activity=None, flags=Flags())
    kind = DeliveryEventType(f"delivery.{end.state.lower()}")
    return Progress(end, (*news, Happening(kind, report.at, told.ended(end, report))))


def _end(delivery: Delivery, report: MissionReport) -> DeliveryState:
    if any(package.state == "DELIVERED" for package in delivery.packages):
        return "PARTIALLY_COMPLETED"
    return "CANCELLED" if report.mission_state == "CANCELLED" else "FAILED"


_BY_KIND: Final[Mapping[str, Callable[[Delivery, Mission, MissionReport], Progress]]] = {
    "ACCEPTED": _accepted,
    "REFUSED": _refused,
    "LOADING": _loading,
    "LOADED": _loaded,
    "ACTIVITY": _activity,
    "DELIVERED": _delivered,
    "REPLANNED": _replanned,
    "ENDED": _ended,
}


def _handed_over(package: PackageStatus, report: MissionReport) -> PackageStatus:
    recipient = Custodian(kind="RECIPIENT", id=package.destination.station_id)
    return _with(
        package, state="DELIVERED", custodian=recipient, eta_at=None, delivered_at=report.at
    )


def _stranded(package: PackageStatus, report: MissionReport) -> PackageStatus:
    # Where a drone went down away from any station, it still holds what it carries.
    holder = (
        package.custodian
        if report.station_id is None
        else Custodian(kind="STATION", id=report.station_id)
    )
    return _with(package, state="STRANDED", custodian=holder, eta_at=None)


def _carries(mission: Mission, package: PackageStatus) -> bool:
    return any(carried.package_id == package.package_id for carried in mission.packages)


def _changed(delivery: Delivery, **changes: object) -> Delivery:
    return delivery.model_copy(update=changes)


def _with(package: PackageStatus, **changes: object) -> PackageStatus:
    return package.model_copy(update=changes)
