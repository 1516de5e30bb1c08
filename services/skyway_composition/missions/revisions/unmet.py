"""Packages that are to come back, but are delivered by the plan that their drone has taken."""

from collections.abc import Sequence

from skyway.contracts.flight_step import DeliverStep, FlightStep
from skyway.ids import PackageId
from skyway_composition.missions.record import MissionRecord


def unmet_returns(record: MissionRecord, steps: Sequence[FlightStep]) -> tuple[PackageId, ...]:
    """Those of which word came while the plan was on its way to the drone."""
    delivered = {
        package_id
        for step in steps
        if isinstance(step, DeliverStep)
        for package_id in step.package_ids
    }
    return tuple(
        aim.package_id
        for aim in record.aims
        if aim.kind == "RETURN" and aim.package_id in delivered
    )
