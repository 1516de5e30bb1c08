"""What changes when packages are loaded, delivered, returned or stranded."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.contracts.delivery_event_data import Custodian
from skyway.contracts.mission import Mission
from skyway.contracts.mission_reports import MissionReport
from skyway.geo import Position
from skyway.ids import PackageId
from skyway_gateway.deliveries.lifecycle import event_data
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, PackageStatus, Proof
from skyway_gateway.deliveries.lifecycle.progress import Progress, changed, with_packages
from skyway_gateway.notifications.delivery_events import Happening

_NUMBER: Final = TypeAdapter(float | None)
_POSITION: Final = TypeAdapter(Position | None)


def loaded(delivery: Delivery, mission: Mission, report: MissionReport) -> Progress:
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


def delivered(delivery: Delivery, mission: Mission, report: MissionReport) -> Progress:
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


def returned(delivery: Delivery, mission: Mission, report: MissionReport) -> Progress:
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
