"""The `data` of each delivery event; no other file decides what an event contains."""

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.message import utc_text
from skyway.contracts.mission import DeliveryMission
from skyway.contracts.mission_reports import MissionReport
from skyway.delivery.offer import Price, total_price
from skyway.ids import PackageId
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, PackageStatus
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission

#: The JSON members of an event; each event type has others.
Data = dict[str, Any]


def requested(delivery: Delivery) -> Data:
    """Data of `delivery.requested`: the request."""
    return {
        "reference": delivery.reference,
        "request": delivery.request.model_dump(mode="json", exclude_none=True),
    }


def changed_by_customer(delivery: Delivery, names: Sequence[str], *, is_rescheduled: bool) -> Data:
    """Data of `delivery.changed`: what the customer has changed, without personal data."""
    request = delivery.request.model_dump(mode="json", exclude_none=True)
    return {
        "changed": list(names),
        "reference": delivery.reference,
        "request": request if is_rescheduled else None,
    }


def scheduled(earliest_pickup_at: datetime, *, books_from_at: datetime) -> Data:
    """Data of `delivery.scheduled`: the pickup, and from when a drone is looked for."""
    return {
        "earliest_pickup_at": utc_text(earliest_pickup_at),
        "books_from_at": utc_text(books_from_at),
    }


def promised(delivery: Delivery, mission: DeliveryMission) -> Data:
    """Data of `delivery.promised`: when the packages of a mission are promised."""
    promises = {each.package_id: each for each in delivery.packages}
    return {
        "packages": [
            {
                "package_id": eta.package_id,
                "eta_at": utc_text(eta.eta_at),
                "eta_p90_at": _text(promises[eta.package_id].promised_p90_at),
                "due_at": _text(promises[eta.package_id].due_at),
            }
            for eta in mission.packages
        ]
    }


def planned(delivery: Delivery, missions: Sequence[DeliveryMission], *, attempt: int) -> Data:
    """Data of `delivery.planned`: drone, price, pickup, ETAs, and packages that still wait."""
    first, *_ = missions
    return {
        "attempt": attempt,
        "provider_id": first.provider_id,
        "drone_id": first.drone_id,
        "mission_ids": [mission.mission_id for mission in missions],
        "price": _priced(delivery),
        "pickup_station_id": delivery.pickup.station_id,
        "pickup_at": utc_text(min(pickup_at(mission) for mission in missions)),
        "delivery_time_s": max(mission.plan.delivery_time_s or 0.0 for mission in missions),
        "packages": [one for each in missions for one in promised(delivery, each)["packages"]],
        "waiting_package_ids": [package.package_id for package in delivery.waiting_packages],
    }


def pickup_at(mission: DeliveryMission) -> datetime:
    """When the drone begins to load at the pickup."""
    return mission.start_at + timedelta(seconds=mission.plan.pickup_s)


def rejected(reasons: Sequence[ProviderReason], detail: str) -> Data:
    """Data of `delivery.rejected`: why no provider flies it."""
    return {"detail": detail, "reasons": [reason.model_dump(mode="json") for reason in reasons]}


def flown_by(mission: DeliveryMission) -> Data:
    """The mission, its provider and its drone."""
    return {
        "mission_id": mission.mission_id,
        "provider_id": mission.provider_id,
        "drone_id": mission.drone_id,
    }


def proof_awaited(delivery: Delivery, mission: DeliveryMission, report: MissionReport) -> Data:
    """Data of `delivery.proof_awaited`: which proofs the drone waits for, and until when."""
    asked = {each.package_id: each.dropoff_verification for each in delivery.request.packages}
    return {
        **flown_by(mission),
        "station_id": report.station_id,
        "packages": [
            {"package_id": each, "method": verification.method}
            for each in report.package_ids
            if (verification := asked.get(each)) is not None
        ],
        "until_at": _text(report.until_at),
    }


def loaded(
    package_ids: Sequence[PackageId], mission: DeliveryMission, report: MissionReport
) -> Data:
    """Data of `delivery.loaded`: what the drone has on board, and what the mission costs now."""
    return {
        **flown_by(mission),
        "is_pooled": mission.is_pooled,
        "price": mission.price.model_dump(mode="json"),
        "station_id": report.station_id,
        "package_ids": list(package_ids),
        "evidence": report.data,
    }


def replanned(delivery: Delivery, mission: DeliveryMission, report: MissionReport) -> Data:
    """Data of `delivery.replanned`: why there is a new plan, and how late each package will be.

    A package without an ETA will be left at a station; `given_up` says why.
    """
    etas = {eta.package_id: eta.eta_at for eta in report.etas or mission.packages}
    return {
        **flown_by(mission),
        "revision": mission.revision,
        "code": report.code,
        "detail": report.detail,
        "given_up": mission.given_up,
        "packages": [
            {
                "package_id": one.package_id,
                "state": one.state,
                "eta_at": _text(etas.get(one.package_id)),
                "promised_at": _text(one.promised_at),
                "due_at": _text(one.due_at),
                "later_s": _later_s(one.promised_at, etas.get(one.package_id)),
            }
            for one in delivery.packages
            if one.mission_id == mission.mission_id and not one.is_settled
        ],
    }


def _later_s(promised_at: datetime | None, eta_at: datetime | None) -> float | None:
    if promised_at is None or eta_at is None:
        return None
    return (eta_at - promised_at).total_seconds()


def package_delivered(
    package: PackageStatus, mission: DeliveryMission, report: MissionReport
) -> Data:
    """Data of `package.delivered`: where and when, with the drone's evidence."""
    return {
        **flown_by(mission),
        "package_id": package.package_id,
        "station_id": package.custodian.id,
        "delivered_at": _text(package.delivered_at),
        "evidence": report.data,
    }


def package_returned(
    package: PackageStatus, mission: DeliveryMission, report: MissionReport
) -> Data:
    """Data of `package.returned`: where and why, with the drone's evidence."""
    return {
        **flown_by(mission),
        "package_id": package.package_id,
        "station_id": report.station_id,
        "returned_at": utc_text(report.at),
        "code": package.code,
        "detail": package.detail,
        "evidence": report.data,
    }


def package_stranded(package: PackageStatus, report: MissionReport) -> Data:
    """Data of `package.stranded`: where the package is, and why."""
    return {
        "package_id": package.package_id,
        "station_id": report.station_id,
        "position": package.position and list(package.position),
        "custodian": package.custodian.model_dump(mode="json"),
        "code": report.code,
        "detail": report.detail,
    }


def package_cancelled(package: PackageStatus) -> Data:
    """Data of `package.cancelled`: which package stays at the pickup, and why."""
    return {
        "package_id": package.package_id,
        "station_id": package.custodian.id,
        "custodian": package.custodian.model_dump(mode="json"),
        "code": package.code,
        "detail": package.detail,
    }


def completed(delivery: Delivery) -> Data:
    """Data of `delivery.completed`: planned and actual times, in all and for each package."""
    start_at = min(mission.booked_start_at for mission in delivery.missions)
    promised_at = max(
        (one.promised_at for one in delivery.packages if one.promised_at), default=None
    )
    delivered_at = max(one.delivered_at for one in delivery.packages if one.delivered_at)
    return {
        "price": _priced(delivery),
        "planned": _completion(start_at, promised_at),
        "actual": _completion(start_at, delivered_at),
        "packages": [
            {
                "package_id": one.package_id,
                "promised_at": _text(one.promised_at),
                "due_at": _text(one.due_at),
                "delivered_at": _text(one.delivered_at),
            }
            for one in delivery.packages
        ],
    }


def ended(delivery: Delivery, code: str | None, detail: str | None) -> Data:
    """Data of the other final events: where each package is, and why."""
    return {
        "price": _priced(delivery),
        "code": code,
        "detail": detail,
        "packages": [
            {
                "package_id": one.package_id,
                "state": one.state,
                "custodian": one.custodian.model_dump(mode="json"),
                "position": one.position and list(one.position),
                "delivered_at": _text(one.delivered_at),
                "code": one.code,
                "detail": one.detail,
            }
            for one in delivery.packages
        ],
    }


def price_of(missions: Sequence[FlownMission]) -> Price | None:
    """What all missions cost together, as known now; None without missions."""
    return total_price([mission.owed for mission in missions]) if missions else None


def _priced(delivery: Delivery) -> Data | None:
    return None if delivery.price is None else delivery.price.model_dump(mode="json")


def _completion(start_at: datetime, completed_at: datetime | None) -> Data:
    taken_s = None if completed_at is None else (completed_at - start_at).total_seconds()
    return {"completed_at": _text(completed_at), "delivery_time_s": taken_s}


def _text(moment: datetime | None) -> str | None:
    return None if moment is None else utc_text(moment)
