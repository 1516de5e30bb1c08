"""What reports change in packages: who holds them, their ETAs, and whether they are late."""

from collections.abc import Callable, Mapping
from datetime import datetime, timedelta
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.contracts.delivery_event_data import Custodian
from skyway.contracts.message import utc_text
from skyway.contracts.mission import DeliveryMission
from skyway.contracts.mission_reports import MissionReport
from skyway.geo import Position
from skyway.ids import PackageId
from skyway_gateway.deliveries.lifecycle import event_data
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, PackageStatus, Proof
from skyway_gateway.deliveries.lifecycle.progress import Progress, changed, with_packages
from skyway_gateway.lateness.lateness_forecast import due_of
from skyway_gateway.notifications.delivery_events import Happening

#: A package is late when its ETA passes its `due_at` by more than the larger of two limits.
#: The first limit, seconds of fleet time.
TOLERANCE_S: Final = 60.0

#: The second limit, as a share of the time from the plan's start to `due_at`.
_TOLERANCE_SHARE: Final = 0.02

_NUMBER: Final = TypeAdapter(float | None)
_POSITION: Final = TypeAdapter(Position | None)


def loaded(delivery: Delivery, mission: DeliveryMission, report: MissionReport) -> Progress:
    """The delivery with packages on board of a drone; the first loading starts the delivery."""
    drone = Custodian(kind="DRONE", id=mission.drone_id)

    def is_loaded(package: PackageStatus) -> bool:
        is_named = not report.package_ids or package.package_id in report.package_ids
        return is_named and package.state == "CREATED" and package.mission_id == mission.mission_id

    package_ids = tuple(one.package_id for one in delivery.packages if is_loaded(one))
    if not package_ids:  # all of them were cancelled while the drone was loaded
        return Progress(delivery)
    data = event_data.loaded(package_ids, mission, report)
    news = [Happening(DeliveryEventType.LOADED, report.at, data)]
    if delivery.state != "IN_PROGRESS":
        news.append(Happening(DeliveryEventType.STARTED, report.at, event_data.flown_by(mission)))

    def load(package: PackageStatus) -> dict[str, object]:
        # A package that was cancelled during loading comes back.
        state = "LOADED" if package.code is None else "RETURNING"
        return {"state": state, "custodian": drone}

    after = with_packages(delivery, load, where=is_loaded)
    activity = report.activity or delivery.activity
    return Progress(changed(after, state="IN_PROGRESS", activity=activity), tuple(news))


def delivered(delivery: Delivery, mission: DeliveryMission, report: MissionReport) -> Progress:
    """The delivery with packages handed to their recipients."""

    def hand_over(package: PackageStatus) -> dict[str, object]:
        station_id = report.station_id or package.destination.station_id
        return {
            "state": "DELIVERED",
            "custodian": Custodian(kind="RECIPIENT", id=station_id),
            "eta_at": None,
            "delivered_at": report.at,
            # A reason from before the delivery no longer holds.
            "code": None,
            "detail": None,
            "proof": _proof(report, package.package_id),
        }

    return _with_events(
        delivery,
        with_packages(delivery, hand_over, where=_is_named(report)),
        DeliveryEventType.PACKAGE_DELIVERED,
        data_of=lambda package: event_data.package_delivered(package, mission, report),
        report=report,
    )


def returned(delivery: Delivery, mission: DeliveryMission, report: MissionReport) -> Progress:
    """The delivery with packages returned to a station, usually the pickup."""

    def give_back(package: PackageStatus) -> dict[str, object]:
        return {
            "state": "RETURNED",
            "custodian": _station_or_drone(package, report),
            "eta_at": None,
            "code": package.code or report.code,
            "detail": package.detail or report.detail,
            "proof": _proof(report, package.package_id),
        }

    return _with_events(
        delivery,
        with_packages(delivery, give_back, where=_is_named(report)),
        DeliveryEventType.PACKAGE_RETURNED,
        data_of=lambda package: event_data.package_returned(package, mission, report),
        report=report,
    )


def stranded(
    delivery: Delivery, report: MissionReport, *, where: Callable[[PackageStatus], bool]
) -> Progress:
    """The delivery with packages left where their drone ended its mission."""

    def leave(package: PackageStatus) -> dict[str, object]:
        return {
            "state": "STRANDED",
            "custodian": _station_or_drone(package, report),
            "position": report.position,
            "eta_at": None,
            "code": report.code,
            "detail": report.detail,
        }

    return _with_events(
        delivery,
        with_packages(delivery, leave, where=lambda one: where(one) and not one.is_settled),
        DeliveryEventType.PACKAGE_STRANDED,
        data_of=lambda package: event_data.package_stranded(package, report),
        report=report,
    )


def _with_events(
    before: Delivery,
    after: Delivery,
    kind: DeliveryEventType,
    *,
    data_of: Callable[[PackageStatus], dict[str, Any]],  # members of an event's data
    report: MissionReport,
) -> Progress:
    """The changed delivery with one event for each package whose state has changed."""
    return Progress(
        after,
        tuple(
            Happening(kind, report.at, data_of(now))
            for then, now in zip(before.packages, after.packages, strict=True)
            if then.state != now.state
        ),
    )


def _is_named(report: MissionReport) -> Callable[[PackageStatus], bool]:
    return lambda one: one.package_id in report.package_ids and not one.is_settled


def _station_or_drone(package: PackageStatus, report: MissionReport) -> Custodian:
    # A drone that went down away from a station still holds its packages.
    if report.station_id is None:
        return package.custodian
    return Custodian(kind="STATION", id=report.station_id)


def _proof(report: MissionReport, package_id: PackageId) -> Proof:
    """The proof of this package in a report; evidence in an unknown form is left out."""
    evidence = report.data
    masses_kg, place = evidence.get("mass_kg"), evidence.get("place")
    mass_kg = masses_kg.get(package_id) if isinstance(masses_kg, Mapping) else None
    position = place.get("position") if isinstance(place, Mapping) else None
    return Proof(
        station_id=report.station_id,
        position=_read(_POSITION, position),
        at=report.at,
        mission_id=report.mission_id,
        provider_id=report.provider_id,
        drone_id=report.drone_id,
        soc=report.soc,
        mass_kg=_read(_NUMBER, mass_kg),
        load_before_kg=_read(_NUMBER, evidence.get("load_before_kg")),
        load_after_kg=_read(_NUMBER, evidence.get("load_after_kg")),
    )


def _read(form: TypeAdapter[Any], value: object) -> Any:  # of the adapter's type, or None
    # Evidence that cannot be read must not hold up the delivery.
    try:
        return form.validate_python(value)
    except ValidationError:
        return None


def with_etas(
    delivery: Delivery, report: MissionReport, *, host_delay: timedelta
) -> tuple[Delivery, tuple[Happening, ...]]:
    """The delivery with a report's ETAs, and an event if they make it late."""
    etas, replanned = report.etas, None
    if report.kind == "REPLANNED" and report.mission is not None:
        etas, replanned = etas or report.mission.packages, report.mission.mission_id
    new = {eta.package_id: eta.eta_at for eta in etas}
    after = with_packages(
        delivery,
        # A package that the new plan leaves out has no ETA.
        lambda one: {"eta_at": new.get(one.package_id)},
        where=lambda one: (
            (one.package_id in new or (replanned is not None and one.mission_id == replanned))
            and not one.is_settled
        ),
    )
    return _with_lateness(after, at=report.at, host_delay=host_delay)


def with_promises(delivery: Delivery, mission: DeliveryMission) -> Delivery:
    """The delivery whose packages are promised for the arrival times of this mission.

    A P90 stays as long after its P50 as it was.
    """
    etas = {each.package_id: each.eta_at for each in mission.packages}

    def promise(package: PackageStatus) -> dict[str, object]:
        eta_at, before_at, p90_at = (
            etas[package.package_id],
            package.promised_at,
            package.promised_p90_at,
        )
        if p90_at is not None and before_at is not None:
            p90_at = eta_at + (p90_at - before_at)
        return {
            "promised_at": eta_at,
            "promised_p90_at": p90_at,
            "due_at": due_of(package.package_id, eta_at, p90_at, delivery.request),
            "eta_at": eta_at,
        }

    return with_packages(
        delivery,
        promise,
        where=lambda one: one.mission_id == mission.mission_id and one.package_id in etas,
    )


def when_overdue(
    delivery: Delivery, *, at: datetime, host_delay: timedelta
) -> tuple[Delivery, tuple[Happening, ...]]:
    """The delivery with passed ETAs moved to now, and an event if that makes it late.

    For missions that no longer report: a package that should have arrived is late by now.
    """
    after = with_packages(
        delivery,
        lambda _: {"eta_at": at},
        where=lambda one: not one.is_settled and one.eta_at is not None and one.eta_at < at,
    )
    return _with_lateness(after, at=at, host_delay=host_delay)


def _with_lateness(
    delivery: Delivery, *, at: datetime, host_delay: timedelta
) -> tuple[Delivery, tuple[Happening, ...]]:
    late = [each for each in delivery.packages if _is_late(each, delivery, host_delay)]
    flags = delivery.flags.model_copy(update={"delayed": bool(late)})
    after = changed(delivery, flags=flags)
    if not late or delivery.flags.delayed:
        return after, ()
    data = {"packages": [_lateness(package, delivery) for package in late]}
    return after, (Happening(DeliveryEventType.DELAYED, at, data),)


def _is_late(package: PackageStatus, delivery: Delivery, host_delay: timedelta) -> bool:
    if package.is_settled or package.eta_at is None or package.due_at is None:
        return False
    eta_at = package.eta_at - host_delay
    limits = (delivery.request.qos.deadline_at, _latest_at(package, delivery))
    if any(limit is not None and eta_at > limit for limit in limits):
        return True
    if delivery.is_provisional:
        return False
    promised_s = (package.due_at - _start_at(package, delivery)).total_seconds()
    tolerance_s = max(TOLERANCE_S, _TOLERANCE_SHARE * promised_s)
    return eta_at - package.due_at > timedelta(seconds=tolerance_s)


def with_p90(delivery: Delivery) -> Delivery:
    """The delivery with the P90 of each ETA: the margin shrinks with the way that remains."""
    return with_packages(
        delivery,
        lambda package: {"eta_p90_at": _eta_p90_at(package, delivery)},
        where=lambda package: package.eta_at is not None and package.promised_p90_at is not None,
    )


def _eta_p90_at(package: PackageStatus, delivery: Delivery) -> datetime | None:
    eta_at, promised_at, p90_at = package.eta_at, package.promised_at, package.promised_p90_at
    if eta_at is None or promised_at is None or p90_at is None:
        return None
    planned_s = (promised_at - _start_at(package, delivery)).total_seconds()
    remaining_s = (eta_at - delivery.updated_at).total_seconds()
    share = min(max(remaining_s / planned_s, 0.0), 1.0) if planned_s > 0 else 1.0
    return eta_at + share * (p90_at - promised_at)


def _start_at(package: PackageStatus, delivery: Delivery) -> datetime:
    for mission in delivery.missions:
        if mission.mission_id == package.mission_id:
            return mission.booked_start_at
    return delivery.created_at


def _lateness(package: PackageStatus, delivery: Delivery) -> dict[str, object]:
    late = package.eta_at and package.due_at and package.eta_at - package.due_at
    deadline_at, latest_at = delivery.request.qos.deadline_at, _latest_at(package, delivery)
    return {
        "package_id": package.package_id,
        "promised_at": package.promised_at and utc_text(package.promised_at),
        "due_at": package.due_at and utc_text(package.due_at),
        "eta_at": package.eta_at and utc_text(package.eta_at),
        "late_s": late and late.total_seconds(),
        "deadline_at": deadline_at and utc_text(deadline_at),
        "latest_at": latest_at and utc_text(latest_at),
    }


def _latest_at(package: PackageStatus, delivery: Delivery) -> datetime | None:
    """The end of the package's window; None without one."""
    return next(
        (
            each.latest_at
            for each in delivery.request.packages
            if each.package_id == package.package_id
        ),
        None,
    )
