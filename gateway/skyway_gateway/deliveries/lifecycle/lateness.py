"""New ETAs, and whether they are later than the promised moments."""

from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.contracts.message import utc_text
from skyway.contracts.mission_reports import MissionReport
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, PackageStatus
from skyway_gateway.deliveries.lifecycle.progress import changed, with_packages
from skyway_gateway.notifications.delivery_events import Happening

#: A package is late when its ETA passes its promise by more than the larger of two limits.
#: The first limit, seconds of fleet time.
TOLERANCE_S: Final = 60.0
#: The second limit, as a share of the time from the plan's start to the promise.
_TOLERANCE_SHARE: Final = 0.02


def with_etas(delivery: Delivery, report: MissionReport) -> tuple[Delivery, tuple[Happening, ...]]:
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
    return _with_lateness(after, at=report.at)


def when_overdue(delivery: Delivery, *, at: datetime) -> tuple[Delivery, tuple[Happening, ...]]:
    """The delivery with passed ETAs moved to now, and an event if that makes it late.

    For missions that no longer report: a package that should have arrived is late by now.
    """
    after = with_packages(
        delivery,
        lambda _: {"eta_at": at},
        where=lambda one: not one.is_settled and one.eta_at is not None and one.eta_at < at,
    )
    return _with_lateness(after, at=at)


def _with_lateness(delivery: Delivery, *, at: datetime) -> tuple[Delivery, tuple[Happening, ...]]:
    late = [package for package in delivery.packages if _is_late(package, delivery)]
    flags = delivery.flags.model_copy(update={"delayed": bool(late)})
    after = changed(delivery, flags=flags)
    if not late or delivery.flags.delayed:
        return after, ()
    data = {"packages": [_lateness(package, delivery) for package in late]}
    return after, (Happening(DeliveryEventType.DELAYED, at, data),)


def _is_late(package: PackageStatus, delivery: Delivery) -> bool:
    if package.is_settled or package.eta_at is None or package.promised_at is None:
        return False
    limits = (delivery.request.qos.deadline_at, _latest_at(package, delivery))
    if any(limit is not None and package.eta_at > limit for limit in limits):
        return True
    promised_s = (package.promised_at - _start_at(package, delivery)).total_seconds()
    tolerance_s = max(TOLERANCE_S, _TOLERANCE_SHARE * promised_s)
    return package.eta_at - package.promised_at > timedelta(seconds=tolerance_s)


def _start_at(package: PackageStatus, delivery: Delivery) -> datetime:
    for mission in delivery.missions:
        if mission.mission_id == package.mission_id:
            return mission.begins_at
    return delivery.created_at


def _lateness(package: PackageStatus, delivery: Delivery) -> dict[str, object]:
    late = package.eta_at and package.promised_at and package.eta_at - package.promised_at
    deadline_at, latest_at = delivery.request.qos.deadline_at, _latest_at(package, delivery)
    return {
        "package_id": package.package_id,
        "promised_at": package.promised_at and utc_text(package.promised_at),
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
