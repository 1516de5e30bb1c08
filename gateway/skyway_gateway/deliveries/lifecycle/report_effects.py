"""What a mission report changes in a delivery, and which events it causes.

Each report comes once, in the order of its mission. Reports of several missions may mix.
"""

from collections.abc import Callable, Mapping
from datetime import timedelta
from typing import Final

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.contracts.mission import DeliveryMission
from skyway.contracts.mission_reports import MissionReport
from skyway_gateway.deliveries.lifecycle import event_data
from skyway_gateway.deliveries.lifecycle.charges import with_charges
from skyway_gateway.deliveries.lifecycle.delivery import (
    ON_BOARD_STATES,
    Delivery,
    DeliveryState,
    PackageStatus,
    ProofWait,
)
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission, Refusal
from skyway_gateway.deliveries.lifecycle.package_changes import (
    delivered,
    loaded,
    returned,
    stranded,
    with_etas,
    with_promises,
)
from skyway_gateway.deliveries.lifecycle.progress import (
    CANCELLED_CODE,
    Progress,
    changed,
    settled,
    with_cancelled,
    with_flags,
    with_packages,
    with_returning,
)
from skyway_gateway.notifications.delivery_events import Happening


def after_report(delivery: Delivery, report: MissionReport, *, host_delay: timedelta) -> Progress:
    """The delivery after a report about one of its missions.

    `host_delay` is the lateness that does not count: the machine alone may have caused it.
    """
    reported = [one for one in delivery.missions if one.mission_id == report.mission_id]
    if not reported:  # a mission of an earlier attempt: the delivery goes on without it
        return Progress(delivery)
    mission = _mission_after(reported[0], report)
    missions = tuple(
        mission if one.mission_id == mission.mission_id else one for one in delivery.missions
    )
    delivery = changed(
        delivery,
        updated_at=max(delivery.updated_at, report.at),
        missions=missions,
        price=event_data.price_of(missions),
        provider_id=missions[0].provider_id,
    )
    if delivery.is_over:  # the drone's way home does not concern the customer
        return Progress(delivery)
    if delivery.activity == "OUT_OF_CONTACT":
        # Each report says what has become of the drone; only another ACTIVITY repeats the doubt.
        delivery = changed(delivery, activity=None)
    progress = _BY_KIND[report.kind](delivery, mission, report)
    progress = Progress(with_flags(progress.delivery), progress.happenings)
    progress = with_charges(progress, host_delay=host_delay)
    progress = settled(progress, at=report.at, code=report.code, detail=report.detail)
    if progress.delivery.is_over:
        return progress
    delivery, late = with_etas(progress.delivery, report, host_delay=host_delay)
    return Progress(delivery, progress.happenings + late)


def _mission_after(before: FlownMission, report: MissionReport) -> FlownMission:
    is_replanning = before.is_replanning
    if report.kind in ("REPLANNING", "REPLANNED"):
        is_replanning = report.kind == "REPLANNING"
    return FlownMission.model_validate(
        {
            **dict(report.mission or before),
            # Whether a mission was sent already does not concern the customer.
            "state": "BOOKED" if report.mission_state == "QUEUED" else report.mission_state,
            "is_replanning": is_replanning,
            "booked_start_at": (
                report.mission.start_at
                if report.kind == "PROMISED" and report.mission is not None
                else before.booked_start_at
            ),
            "charged": before.charged,
        }
    )


def _promised(delivery: Delivery, mission: DeliveryMission, report: MissionReport) -> Progress:
    """The promise is firm: the packages are promised for the times of the mission's plan."""
    firm = with_promises(delivery, mission)
    news = Happening(DeliveryEventType.PROMISED, report.at, event_data.promised(firm, mission))
    return Progress(firm, (news,))


def _accepted(delivery: Delivery, mission: DeliveryMission, report: MissionReport) -> Progress:
    if delivery.state != "PLANNED":
        return Progress(delivery)
    news = Happening(DeliveryEventType.DISPATCHED, report.at, event_data.flown_by(mission))
    return Progress(changed(delivery, state="DISPATCHED"), (news,))


def _loading(delivery: Delivery, _mission: DeliveryMission, _report: MissionReport) -> Progress:
    has_begun = delivery.state in ("PLANNED", "DISPATCHED")
    return Progress(changed(delivery, state="LOADING") if has_begun else delivery)


def _activity(delivery: Delivery, mission: DeliveryMission, report: MissionReport) -> Progress:
    if report.activity == "OUT_OF_CONTACT":  # possible in every state
        return Progress(changed(delivery, activity=report.activity))
    if delivery.state != "IN_PROGRESS":
        return Progress(delivery)
    if report.activity == "FLYING":
        delivery = with_packages(
            delivery,
            lambda _: {"state": "IN_TRANSIT"},
            where=lambda one: one.state == "LOADED" and one.mission_id == mission.mission_id,
        )
    return Progress(changed(delivery, activity=report.activity or delivery.activity))


def _proof_awaited(delivery: Delivery, mission: DeliveryMission, report: MissionReport) -> Progress:
    if report.until_at is None:
        return Progress(delivery)
    wait = ProofWait(since_at=report.at, until_at=report.until_at)
    after = with_packages(
        delivery,
        lambda _: {"proof_wait": wait},
        where=lambda one: (
            one.package_id in report.package_ids and one.mission_id == mission.mission_id
        ),
    )
    data = event_data.proof_awaited(delivery, mission, report)
    return Progress(after, (Happening(DeliveryEventType.PROOF_AWAITED, report.at, data),))


def _no_change(delivery: Delivery, _mission: DeliveryMission, _report: MissionReport) -> Progress:
    return Progress(delivery)


def _replanned(delivery: Delivery, mission: DeliveryMission, report: MissionReport) -> Progress:
    data = event_data.replanned(delivery, mission, report)
    return Progress(delivery, (Happening(DeliveryEventType.REPLANNED, report.at, data),))


def _returning(delivery: Delivery, _mission: DeliveryMission, report: MissionReport) -> Progress:
    """Causes no event: the new plan and the return of each package cause theirs."""
    after = with_returning(delivery, report.package_ids, code=report.code, detail=report.detail)
    return Progress(after)


def _released(delivery: Delivery, _mission: DeliveryMission, report: MissionReport) -> Progress:
    return with_cancelled(
        delivery,
        where=lambda one: one.package_id in report.package_ids and one.state == "CREATED",
        code=report.code or CANCELLED_CODE,
        detail=report.detail,
        at=report.at,
    )


def _ended(delivery: Delivery, mission: DeliveryMission, report: MissionReport) -> Progress:
    """The mission is over; packages that it has not handed over stay where they are."""

    def is_its_own(package: PackageStatus) -> bool:
        return package.mission_id == mission.mission_id

    left = stranded(
        delivery,
        report,
        where=lambda one: (
            is_its_own(one)
            and (one.state in ON_BOARD_STATES or one.package_id in report.stranded_package_ids)
        ),
    )
    cancelled = with_cancelled(
        left.delivery,
        where=lambda one: is_its_own(one) and one.state == "CREATED",
        code=report.code,
        detail=report.detail,
        at=report.at,
    )
    return Progress(cancelled.delivery, left.happenings + cancelled.happenings)


def _refused(delivery: Delivery, mission: FlownMission, report: MissionReport) -> Progress:
    """The delivery without this mission: its packages wait for another drone.

    Packages that were cancelled meanwhile do not wait: they stay at the pickup.
    """
    refusal = Refusal(
        attempt=report.attempt,
        provider_id=mission.provider_id,
        drone_id=mission.drone_id,
        code=report.code,
        detail=report.detail,
        pickup_at=event_data.pickup_at(mission) if mission.pickup_away_m else None,
    )

    def is_left(package: PackageStatus) -> bool:
        return package.mission_id == mission.mission_id and package.state == "CREATED"

    cancelled = with_cancelled(
        delivery,
        where=lambda one: is_left(one) and one.code is not None,
        code=report.code,
        detail=report.detail,
        at=report.at,
    )
    without = with_packages(
        cancelled.delivery,
        lambda _: {
            "mission_id": None,
            "promised_at": None,
            "promised_p90_at": None,
            "due_at": None,
            "eta_at": None,
        },
        where=is_left,
    )
    # These packages join an attempt that has no missions yet; else they need a new attempt,
    # because composition answers the same attempt with the same missions.
    is_asked = any(one.attempt == delivery.attempt for one in delivery.missions)
    return Progress(
        changed(
            without,
            state=_state_without(without),
            attempt=delivery.attempt + (is_asked and bool(without.waiting_packages)),
            refusals=(*delivery.refusals, refusal),
        ),
        cancelled.happenings,
    )


def _state_without(delivery: Delivery) -> DeliveryState:
    """The state that the other missions give; a delivery that has begun keeps its state."""
    if delivery.state not in ("PLANNED", "DISPATCHED"):
        return delivery.state
    states = {mission.state for mission in delivery.live_missions}
    if not states:
        return "REQUESTED"
    return "PLANNED" if states == {"BOOKED"} else delivery.state


_BY_KIND: Final[Mapping[str, Callable[[Delivery, FlownMission, MissionReport], Progress]]] = {
    "QUEUED": _no_change,
    "PROMISED": _promised,
    "ACCEPTED": _accepted,
    "REFUSED": _refused,
    "LOADING": _loading,
    "LOADED": loaded,
    "ACTIVITY": _activity,
    "PROOF_AWAITED": _proof_awaited,
    "PIN_ENTERED": _no_change,
    "DELIVERED": delivered,
    "REPLANNING": _no_change,
    "REPLANNED": _replanned,
    "RETIMED": _no_change,
    "RETURNING": _returning,
    "RETURNED": returned,
    "RELEASED": _released,
    "ENDED": _ended,
}
