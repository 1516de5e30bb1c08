"""Which pads a mission still needs, and the standby after its last flight.

All other pads are released. A used pad stays reserved for a gap after the drone has left, until the
next drone may come. A standby ends early for the drone's next mission, or is planned again.

A standby is restored when the next mission is gone. Without it, the drone would end its last
mission with little charge, and stay there.
"""

from collections.abc import Iterable, Sequence
from typing import Final

from skyway.contracts.flight_step import FlightStep, RechargeStep, WaitStep
from skyway.contracts.mission import Mission
from skyway.ids import DroneId, MissionId
from skyway.runtime.sql.database import Tx
from skyway.scheduling.standby import StandbyChoice
from skyway.scheduling.trip import (
    SAME_MS,
    BookedPad,
    NoTrip,
    Trip,
    merged,
    shortened_plan,
    shortened_step,
    without,
)
from skyway.units import CHARGE_TOLERANCE, moment_to_ms, ms_to_moment
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.from_trip import StepTerms, finished_wait, flight_steps
from skyway_composition.missions.mission.record import (
    NEXT_MISSION,
    STANDBY_ENDED,
    MissionRecord,
    Trouble,
)
from skyway_composition.missions.mission.step_store import StepRecord, replace_steps, steps_of
from skyway_composition.missions.mission.store import lock_live
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.pads.store import hold, pads_of_queued
from skyway_composition.planning.availability import send_ahead_ms
from skyway_composition.planning.find_trip import way_home
from skyway_composition.planning.problem_for import Standing
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.world import World


async def release_unneeded_pads(work: MissionUnitOfWork, record: MissionRecord) -> None:
    """Reserve only the pads that the mission still needs; `RowRefused` if a new pad is not free.

    A pad that the drone's QUEUED missions hold by then stays theirs: it is the same drone.
    """
    await _hold_needed(work.tx, record, await work.steps.of(record.mission_id))


async def restore_pads(tx: Tx, drone_id: DroneId) -> MissionRecord | None:
    """Reserve again, for the drone's live mission, pads that its QUEUED missions gave up.

    Returns the live mission. A mission that waits for a new plan needs no pads of its old plan.
    """
    live = (await lock_live(tx, [drone_id])).get(drone_id)
    if live is not None and live.stuck is None:
        await _hold_needed(tx, live, await steps_of(tx.connection, live.mission_id))
    return live


async def _hold_needed(tx: Tx, record: MissionRecord, steps: Sequence[StepRecord]) -> None:
    queued = await pads_of_queued(tx.connection, record.drone_id)
    await hold(tx, record.mission_id, without(_needed_pads(record, steps), queued))


def pads_of(steps: Iterable[FlightStep], *, pad_gap_s: float) -> tuple[BookedPad, ...]:
    """The pads at which these steps charge, each with the gap until the next drone may come."""
    gap_ms = round(pad_gap_s * 1000)
    return merged(
        BookedPad(
            step.station_id,
            step.pad,
            moment_to_ms(step.not_before_at),
            moment_to_ms(step.not_after_at) + gap_ms,
        )
        for step in steps
        if isinstance(step, RechargeStep) and step.not_before_at < step.not_after_at
    )


def _used_pads(steps: Iterable[StepRecord], *, pad_gap_s: float) -> tuple[BookedPad, ...]:
    """The pads at which the drone has charged, each until the gap after it is over."""
    gap_ms = round(pad_gap_s * 1000)
    sessions = (
        BookedPad(
            each.step.station_id,
            each.step.pad,
            moment_to_ms(each.step.not_before_at),
            moment_to_ms(min(each.event.ended_at, each.step.not_after_at)) + gap_ms,
        )
        for each in steps
        if isinstance(each.step, RechargeStep)
        and each.status == "ENDED"
        and each.event is not None
        and each.step.not_before_at < each.step.not_after_at
    )
    return merged(each for each in sessions if each.start_ms < each.end_ms)


def _needed_pads(record: MissionRecord, steps: Sequence[StepRecord]) -> tuple[BookedPad, ...]:
    """The pads of the steps ahead, and of a proposal until the drone has answered it."""
    gap_s = record.mission.margins.pad_gap_s
    planned = [each.step for each in steps if each.status == "PLANNED"]
    needed = merged((*pads_of(planned, pad_gap_s=gap_s), *_used_pads(steps, pad_gap_s=gap_s)))
    proposal = record.proposal
    if proposal is None:
        return needed
    proposed_gap_s = proposal.mission.margins.pad_gap_s
    return merged((*needed, *pads_of(proposal.steps, pad_gap_s=proposed_gap_s)))


#: A mission that can begin this much sooner is planned again, fleet milliseconds. Our own choice.
WORTH_MS: Final = 60_000


async def end_standby_before(tx: Tx, mission_id: MissionId, until_ms: int) -> None:
    """End the standby of a QUEUED mission early; its drone's link is locked.

    The standby of a mission that was sent ends only when its drone has accepted the change.
    """
    record = await store.get(tx.connection, mission_id, provider_id=None)
    if record is not None and record.mission.state == "QUEUED":
        await shorten_queued(tx, record, until_ms)


def shortened_mission(mission: Mission, *, served_ms: int, until_ms: int) -> Mission:
    """The mission without the part of its standby after `until_ms`.

    `served_ms` is the end of its plan, from which the seconds of its standby count.
    """
    until_s = (until_ms - served_ms) / 1000
    home_plan, home_recharge = mission.home_plan, mission.home_recharge
    return mission.model_copy(
        update={
            "home_plan": None if home_plan is None else shortened_plan(home_plan, until_s),
            "home_recharge": None
            if home_recharge is None
            else shortened_step(home_recharge, until_s),
            "released_at": ms_to_moment(min(until_ms, moment_to_ms(mission.released_at))),
        }
    )


def shortened_steps(
    steps: Sequence[FlightStep], *, until_ms: int
) -> tuple[int, tuple[FlightStep, ...]] | None:
    """The first step that changes, and the steps that replace it and all after it.

    None when no step ends after `until_ms`. A recharge or wait under way then is shortened; all
    later steps are left out.
    """
    until_at = ms_to_moment(until_ms)
    for step in steps:
        if moment_to_ms(step.planned_end_at) <= until_ms + SAME_MS:
            continue
        if moment_to_ms(step.planned_start_at) >= until_ms - SAME_MS:
            return step.step_id, ()
        if isinstance(step, RechargeStep):
            update = {"planned_end_at": until_at, "not_after_at": min(step.not_after_at, until_at)}
            return step.step_id, (step.model_copy(update=update),)
        if isinstance(step, WaitStep):
            update = {"planned_end_at": until_at, "until_at": until_at}
            return step.step_id, (step.model_copy(update=update),)
        raise ValueError(f"step {step.step_id} ({step.kind}) cannot end at {until_at}")
    return None


async def shorten_queued(tx: Tx, record: MissionRecord, until_ms: int) -> None:
    """Leave out what a QUEUED mission would do after this moment, and free those pads."""
    steps = [each.step for each in await steps_of(tx.connection, record.mission_id)]
    changed = shortened_steps(steps, until_ms=until_ms)
    if changed is None:
        return
    first_step, replacement = changed
    await replace_steps(tx, record.mission_id, replacement, first_step=first_step, revision=1)
    kept = (*(each for each in steps if each.step_id < first_step), *replacement)
    pad_gap_s = record.mission.margins.pad_gap_s
    await hold(tx, record.mission_id, pads_of(kept, pad_gap_s=pad_gap_s))
    mission = shortened_mission(record.mission, served_ms=record.served_ms, until_ms=until_ms)
    await store.save_all(tx, [record.with_mission(mission)])


async def restore_standby(work: MissionUnitOfWork, left: MissionRecord) -> None:
    """Request a plan with a standby for the mission before one that has left the calendar."""
    if await store.queued_of_drone(work.tx.connection, left.drone_id):
        await work.plan_queue_again(left.drone_id)
        return
    live = work.missions.get(left.drone_id)
    if live is None or live.trouble is not None or live.stuck is not None or not live.stays:
        return
    if _has_ended_early(live):
        detail = "the next mission has left the drone's calendar"
        await work.save(live.with_trouble(Trouble(code=STANDBY_ENDED, detail=detail)))


async def begin_sooner(work: MissionUnitOfWork, drone_id: DroneId) -> None:
    """Have a drone's QUEUED missions planned again if the next one may begin sooner than planned.

    Without this, an idle drone is not looked at until its next mission is near.
    """
    first = next(iter(await store.queued_of_drone(work.tx.connection, drone_id)), None)
    if first is None:
        return
    near_ms = moment_to_ms(work.clock.now()) + send_ahead_ms(work.clock)
    if first.start.at_ms > max(near_ms, first.earliest_ms + WORTH_MS):
        await work.plan_queue_again(drone_id)


def _has_ended_early(live: MissionRecord) -> bool:
    """Whether the drone's standby is left out or cut short, now or by the plan on its way."""
    is_proposed = live.proposal is not None and live.proposal.code == NEXT_MISSION
    if is_proposed or moment_to_ms(live.mission.released_at) <= live.served_ms:
        return True
    last, drone = live.stays[-1], live.candidate
    is_away = drone.standby == "HOME" and last.station_id != drone.home_station_id
    return is_away or last.soc_from < drone.model.top_soc - CHARGE_TOLERANCE


async def trip_with_other_standby(
    solver: SolverPool, world: World, record: MissionRecord, *, energy_margin: float = 0.0
) -> Trip | NoTrip:
    """The mission's trip with the best standby in this world after the same service.

    The mission has stays. Its pads count as free in `world`. The drone's own `energy_margin` counts
    if it is larger than the network's.
    """
    served, candidate = record.stays[0], record.candidate
    return await way_home(
        solver,
        world.for_drone(candidate.learned),
        record.mission.plan,
        standing=Standing(
            candidate.planned_model, served.soc_from, served.station_id, energy_margin
        ),
        standby=StandbyChoice.of(candidate),
        start_ms=moment_to_ms(record.mission.start_at),
    )


def with_standby_of(mission: Mission, trip: Trip, *, revision: int) -> Mission:
    """The mission as this revision, with the standby of a trip that has the same service."""
    return mission.model_copy(
        update={
            "revision": revision,
            "released_at": ms_to_moment(trip.released_ms),
            "home_plan": trip.home_plan,
            "home_recharge": trip.home_recharge,
        }
    )


def standby_steps(
    record: MissionRecord, trip: Trip, world: World, *, first_step: int
) -> tuple[FlightStep, ...]:
    """The steps of a trip's standby; a wait of no duration if it has none."""
    skyway = world.skyway
    steps = flight_steps(
        skyway.network,
        [*trip.steps()][len(trip.plan.steps) :],
        terms=StepTerms.of(record, skyway.settings),
        first_step=first_step,
    )
    if steps:
        return steps
    station_id = record.stays[0].station_id
    return (finished_wait(station_id, trip.home_start_ms, step_id=first_step),)
