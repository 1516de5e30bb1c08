"""A drone that will not fly its mission: its packages wait for another one."""

from skyway.contracts.mission import MissionReport
from skyway_gateway.deliveries.delivery import Delivery, FlownMission, PackageStatus, Refusal
from skyway_gateway.deliveries.progress import Progress, changed, with_cancelled, with_packages
from skyway_gateway.deliveries.states import DeliveryState


def refused(delivery: Delivery, mission: FlownMission, report: MissionReport) -> Progress:
    """The delivery without this mission; `book` asks anew, without this drone.

    Packages that were to be brought back at once are not asked for again.
    """
    refusal = Refusal(
        attempt=report.attempt,
        provider_id=mission.provider_id,
        drone_id=mission.drone_id,
        code=report.code,
        detail=report.detail,
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
        lambda _: {"mission_id": None, "promised_at": None, "eta_at": None},
        where=is_left,
    )
    # An attempt that is still to be booked takes these packages too: composition has not been
    # asked for it, or has answered that it books nothing.
    is_asked = any(one.attempt == delivery.attempt for one in delivery.missions)
    return Progress(
        changed(
            without,
            state=_state_without(without),
            attempt=delivery.attempt + (is_asked and bool(without.waiting)),
            refusals=(*delivery.refusals, refusal),
        ),
        cancelled.happenings,
    )


def _state_without(delivery: Delivery) -> DeliveryState:
    """How far the delivery is by its other missions; what has begun is never undone."""
    if delivery.state not in ("PLANNED", "DISPATCHED"):
        return delivery.state
    states = {mission.state for mission in delivery.live_missions}
    if not states:
        return "REQUESTED"
    return "PLANNED" if states == {"BOOKED"} else delivery.state
