"""What is done when there is no plan for a mission, or none that may be flown now."""

from dataclasses import replace

from skyway.contracts.flight_step import PickUpStep
from skyway_composition.links.instruction_store import open_instructions
from skyway_composition.missions.ending import abort, cancel
from skyway_composition.missions.hold import hold
from skyway_composition.missions.mission_alarm import raise_alarm
from skyway_composition.missions.outlook.situation import Situation
from skyway_composition.missions.record import MissionRecord, Trouble
from skyway_composition.missions.rest.anchor import Anchor
from skyway_composition.missions.watch import Watch


async def give_up(watch: Watch, record: MissionRecord, *, code: str, detail: str) -> None:
    """End a mission whose drone stands, where it stands."""
    if record.stuck is not None:
        await abort(watch, record, at=watch.clock.now(), code=code, detail=detail)
    else:
        await cancel(watch, record, code=code, detail=detail)


def refusal_code(situation: Situation, trouble: Trouble, *, code: str) -> str:
    """Why nothing is flown: the packages weigh otherwise than planned, or the planner's word."""
    planned = {
        package.package_id: package.mass_kg
        for step in situation.planned
        if isinstance(step, PickUpStep)
        for package in step.packages
    }
    loaded = {each.package_id: each.mass_kg for each in trouble.loaded or ()}
    return "MASS_MISMATCH" if loaded and loaded != planned else code


async def hold_for_stop(watch: Watch, record: MissionRecord, *, stop: str) -> None:
    """Keep a drone on the ground while a ground stop lasts; its next revision ends the hold."""
    state = watch.links[record.drone_id].state
    if state is not None and state.is_held and state.mission_id == record.mission_id:
        return
    sent = await open_instructions(watch.tx, record.drone_id)
    if any(each.kind == "HOLD" for each in sent):
        return
    await hold(watch, record, reason=stop)


async def raise_no_landing(watch: Watch, record: MissionRecord, anchor: Anchor) -> None:
    """Tell operators of a drone that lands where nobody should, since it can reach nothing else."""
    await raise_alarm(
        watch,
        record,
        level="CRITICAL",
        code="NO_SAFE_LANDING",
        detail=f"no open station is in reach; the drone lands at {anchor.station_id!r}",
        station_id=anchor.station_id,
        data={"soc": anchor.soc},
    )


async def stop_trying(watch: Watch, record: MissionRecord, trouble: Trouble) -> None:
    """Let a drone that refuses every revision fly on by its plan, and tell operators.

    The trouble stays: without it the same would be found, and told, every second.
    """
    await raise_alarm(
        watch,
        record,
        level="URGENT",
        code="REVISIONS_REFUSED",
        detail=f"no revision was taken; the drone flies on in spite of {trouble.code}",
    )


async def stop_diverting(watch: Watch, record: MissionRecord, *, reason: str) -> None:
    """Leave a drone held where it stands or lands next, since it cannot go where it was sent."""
    await raise_alarm(
        watch,
        record,
        level="URGENT",
        code="DIVERSION_IMPOSSIBLE",
        detail=f"the drone is held where it stands or lands next; {reason}",
    )
    await watch.keep(replace(record, trouble=None))
