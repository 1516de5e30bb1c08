"""Decides whether packages can still stay at the pickup, or may be loaded already."""

from collections.abc import Sequence
from datetime import timedelta
from typing import Final

from skyway.contracts.flight_step import PickUpStep
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.step_record import StepRecord

#: Longest time until an instruction reaches a drone, seconds of wall time. Our own choice.
_REACHES_DRONE_WITHIN_S: Final = 2.0


#: The same, with the time to make a plan first.
_PLANNED_WITHIN_S: Final = 4.0


def can_stay_at_pickup(
    record: MissionRecord,
    steps: Sequence[StepRecord],
    clock: FleetClock,
    *,
    link: DroneLink,
    needs_plan: bool,
) -> bool:
    """Whether an instruction surely reaches the drone before it loads the packages.

    An automatic PICK_UP that has begun cannot be stopped. A PICK_UP that waits for a loader can be
    stopped until the loader has confirmed. A drone that waits for a revision starts nothing. A
    drone out of reach loads when its time comes, and learns of the cancellation afterwards. A drone
    with events that were not read here may have loaded already.
    """
    if record.is_being_loaded or record.mission.doubt is not None or link.has_unread_events:
        return False
    if record.mission.loading == "AWAITED" or record.stuck is not None:
        return True
    if link.is_gone:
        return False
    margin = _time_to_notify(clock, needs_plan=needs_plan)
    return all(
        each.step.planned_start_at > clock.now() + margin
        for each in steps
        if isinstance(each.step, PickUpStep) and each.status == "PLANNED"
    )


def _time_to_notify(clock: FleetClock, *, needs_plan: bool) -> timedelta:
    wall_s = _PLANNED_WITHIN_S if needs_plan else _REACHES_DRONE_WITHIN_S
    return fleet_margin(clock, fleet_s=5, wall_s=wall_s)
