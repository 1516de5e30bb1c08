"""Decides whether packages stay at the pickup, may still stay there, or may be loaded already."""

from collections.abc import Sequence
from datetime import timedelta
from typing import Final

from skyway.contracts.flight_step import PickUpStep
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.step_store import StepRecord

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
    """Whether an instruction can be expected to reach the drone before it loads the packages.

    This is no proof: see `surely_stays_at_pickup`. An automatic PICK_UP that has begun cannot be
    stopped. A drone out of reach loads when its time comes, and learns of the cancellation
    afterwards.
    """
    if surely_stays_at_pickup(record, link=link):
        return True
    if _may_be_loaded(record, link) or link.is_gone:
        return False
    margin = _time_to_notify(clock, needs_plan=needs_plan)
    return all(
        each.step.planned_start_at > clock.now() + margin
        for each in steps
        if isinstance(each.step, PickUpStep) and each.status == "PLANNED"
    )


def surely_stays_at_pickup(record: MissionRecord, *, link: DroneLink) -> bool:
    """Whether the drone loads nothing before it gets another instruction.

    A PICK_UP that waits for a loader does not end until the loader has confirmed. A drone that
    waits for a revision starts nothing. A drone with events that were not read here may have
    loaded already.
    """
    if _may_be_loaded(record, link):
        return False
    waits_for_revision = record.stuck is not None and record.proposal is None
    return record.mission.loading == "AWAITED" or waits_for_revision


def _may_be_loaded(record: MissionRecord, link: DroneLink) -> bool:
    is_in_doubt = record.mission.doubt is not None
    return record.is_being_loaded or is_in_doubt or link.has_unread_events


def _time_to_notify(clock: FleetClock, *, needs_plan: bool) -> timedelta:
    wall_s = _PLANNED_WITHIN_S if needs_plan else _REACHES_DRONE_WITHIN_S
    return fleet_margin(clock, fleet_s=5, wall_s=wall_s)
