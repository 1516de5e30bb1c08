"""A hand-over of which its drone cannot know whether it was done: it was restarted within it.

What may have been delivered is not delivered again: its aim is the pickup from now on, and people
look where it is. What may have been loaded counts as not loaded, unless the drone names it as on
board: it is then loaded again in its step, and a loader sees that nothing is left to load.
"""

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import DeliverStep, FlightStep, PickUpStep, ReturnStep
from skyway.ids import PackageId
from skyway_composition.missions.following.handing_over import take_on_board
from skyway_composition.missions.mission_alarm import raise_alarm
from skyway_composition.missions.record import MissionRecord
from skyway_composition.missions.rest.aiming import aimed, back_to_pickup
from skyway_composition.missions.revisions.telling import with_aims
from skyway_composition.missions.watch import Watch

#: The code of a STEP_FAILED whose hand-over may or may not have happened.
UNKNOWN = "UNKNOWN"


async def take_unknown_hand_over(
    watch: Watch, record: MissionRecord, step: FlightStep | None, event: DroneEvent
) -> tuple[MissionRecord, str]:
    """The record with what becomes of the packages, and what is told of it."""
    match step:
        case DeliverStep():
            detail = f"it is not known whether {_named(step.package_ids)} were handed over"
            detail = f"{detail} at {step.station_id!r}"
            packages = record.packages(frozenset(step.package_ids))
            aims = aimed(record.aims, [back_to_pickup(record, each) for each in packages])
            record = with_aims(watch, record, aims, code=UNKNOWN, detail=detail)
        case ReturnStep():
            detail = f"it is not known whether {_named(step.package_ids)} were handed back"
            detail = f"{detail} at {step.station_id!r}"
        case PickUpStep():
            package_ids = tuple(each.package_id for each in step.packages)
            detail = f"it is not known whether {_named(package_ids)} were loaded"
            detail = f"{detail} at {step.station_id!r}"
            if event.package_ids:
                record = await take_on_board(watch, record, step, event)
        case _:
            return record, event.detail or "it is not known whether a step was done"
    await raise_alarm(
        watch,
        record,
        level="URGENT",
        code="HAND_OVER_UNKNOWN",
        detail=f"{detail}: the drone was restarted meanwhile; somebody must look",
        station_id=step.station_id,
        data={"step_id": step.step_id, "step_kind": step.kind},
    )
    return record, f"{detail}: the drone was restarted meanwhile"


def _named(package_ids: tuple[PackageId, ...]) -> str:
    return ", ".join(package_ids)
