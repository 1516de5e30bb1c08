"""Whether packages at the pickup can still be kept off the drone that is to take them."""

from collections.abc import Sequence
from datetime import timedelta
from typing import Final

from skyway.contracts.flight_step import PickUpStep
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.custody.chain import Held
from skyway_composition.missions.record import MissionRecord
from skyway_composition.missions.steps.step_record import StepRecord

#: Longest time until a drone has heard us, seconds of wall time. Our own choice.
_HEARD_WITHIN_S: Final = 2.0
#: The same for a plan that has to be made first.
_PLANNED_WITHIN_S: Final = 4.0


def has_never_left(held: Held | None) -> bool:
    """Whether a package still lies where it was brought: the pickup is the first to hold it."""
    return held is None or (held.custodian.kind == "STATION" and held.seq == 1)


def is_being_loaded(record: MissionRecord) -> bool:
    """Whether a loader's word is on its way to the drone: loading ends any moment."""
    return record.trouble is not None and record.trouble.loaded is not None


def can_be_kept_off(
    record: MissionRecord,
    steps: Sequence[StepRecord],
    clock: FleetClock,
    *,
    link: DroneLink,
    needs_plan: bool,
) -> bool:
    """Whether the drone surely hears of it before it takes the packages on board.

    A PICK_UP that has begun by itself cannot be stopped; one that waits for a loader can, until
    the loader has confirmed. A drone that waits for a revision begins nothing. One that is out of
    reach begins to load as soon as it is back, and hears of what was cancelled after that.
    """
    if is_being_loaded(record):
        return False
    if record.mission.loading == "AWAITED" or record.stuck is not None:
        return True
    if link.is_gone:
        return False
    margin = _time_to_tell(clock, needs_plan=needs_plan)
    return all(
        each.step.planned_start_at > clock.now() + margin
        for each in steps
        if isinstance(each.step, PickUpStep) and each.status == "PLANNED"
    )


def _time_to_tell(clock: FleetClock, *, needs_plan: bool) -> timedelta:
    wall_s = _PLANNED_WITHIN_S if needs_plan else _HEARD_WITHIN_S
    return fleet_margin(clock, fleet_s=5, wall_s=wall_s)
