"""New ETAs, and whether they are later than what the customer was promised."""

from datetime import timedelta
from typing import Final

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.contracts.message import utc_text
from skyway.contracts.mission import Mission, MissionReport
from skyway_gateway.deliveries.delivery import Delivery, PackageStatus
from skyway_gateway.notifications.events import Happening

#: Later than promised by more than this, in fleet time, is told: whichever is larger.
_TOLERANCE_S: Final = 60.0
#: The second limit, as a share of the time from the plan's start to the promised moment.
_TOLERANCE_SHARE: Final = 0.02


def with_etas(
    delivery: Delivery, mission: Mission, report: MissionReport
) -> tuple[Delivery, tuple[Happening, ...]]:
    """The delivery with a report's ETAs, and what to tell when it has become late by them."""
    told = report.etas or (mission.packages if report.kind == "REPLANNED" else ())
    new = {eta.package_id: eta.eta_at for eta in told}
    packages = tuple(
        package.model_copy(update={"eta_at": new[package.package_id]})
        if package.package_id in new and package.delivered_at is None
        else package
        for package in delivery.packages
    )
    late = [package for package in packages if _is_late(package, mission)]
    flags = delivery.flags.model_copy(update={"delayed": bool(late)})
    changed = delivery.model_copy(update={"packages": packages, "flags": flags})
    if not late or delivery.flags.delayed:
        return changed, ()
    data = {"packages": [_lateness(package) for package in late]}
    return changed, (Happening(DeliveryEventType.DELAYED, report.at, data),)


def _is_late(package: PackageStatus, mission: Mission) -> bool:
    if package.eta_at is None or package.promised_at is None:
        return False
    promised_s = (package.promised_at - mission.start_at).total_seconds()
    tolerance_s = max(_TOLERANCE_S, _TOLERANCE_SHARE * promised_s)
    return package.eta_at - package.promised_at > timedelta(seconds=tolerance_s)


def _lateness(package: PackageStatus) -> dict[str, object]:
    late = package.eta_at and package.promised_at and package.eta_at - package.promised_at
    return {
        "package_id": package.package_id,
        "promised_at": package.promised_at and utc_text(package.promised_at),
        "eta_at": package.eta_at and utc_text(package.eta_at),
        "late_s": late and late.total_seconds(),
    }
