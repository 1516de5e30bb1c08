"""Which pads a mission still needs; all its other pads are released.

A used pad stays reserved for a gap after the drone has left, until the next drone may come.
"""

from collections.abc import Iterable, Sequence

from skyway.contracts.flight_step import FlightStep, RechargeStep
from skyway.ids import DroneId
from skyway.runtime.sql.database import Tx
from skyway.scheduling.trip import BookedPad, merged, without
from skyway.units import moment_to_ms
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.step_store import StepRecord, steps_of
from skyway_composition.missions.mission.store import lock_live
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.pads.store import hold, pads_of_queued


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
