"""How far a mission is from its plan, and what that means for the packages still to come."""

from collections.abc import Set as AbstractSet
from datetime import datetime, timedelta

from skyway.contracts.flight_step import FlightStep
from skyway.contracts.mission import PackageEta
from skyway.ids import PackageId
from skyway_composition.missions.record import MissionRecord

#: Less lateness than this is not worth telling a customer. Our own choice.
TOLD_LATENESS = timedelta(seconds=60)


def lateness(step: FlightStep, ended_at: datetime) -> timedelta:
    """How much later than planned a step ended; below zero when it was early."""
    return ended_at - step.planned_end_at


def delayed_etas(
    record: MissionRecord, late_by: timedelta, *, delivered: AbstractSet[PackageId]
) -> tuple[PackageEta, ...]:
    """The packages still to come, each as late as the drone is now; empty for a small delay.

    Waits that lie ahead may make up for some of it: these are the latest times, not the likely.
    """
    if late_by < TOLD_LATENESS:
        return ()
    return tuple(
        PackageEta(package_id=eta.package_id, eta_at=eta.eta_at + late_by)
        for eta in record.mission.packages
        if eta.package_id not in delivered
    )
