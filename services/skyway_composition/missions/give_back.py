"""Which pads a mission needs, from the steps that lie ahead; all others go back at once."""

from collections.abc import Iterable

from skyway.contracts.flight_step import FlightStep, RechargeStep
from skyway.units import moment_to_ms
from skyway_composition.missions import store
from skyway_composition.missions.record import MissionRecord
from skyway_composition.missions.watch import Watch
from skyway_composition.pads.booked_pad import BookedPad, merged
from skyway_composition.pads.store import hold


def pads_of(steps: Iterable[FlightStep], *, pad_gap_s: float) -> tuple[BookedPad, ...]:
    """The pads that these steps charge at, each held until the next drone may come."""
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


def needed_pads(record: MissionRecord, planned: Iterable[FlightStep]) -> tuple[BookedPad, ...]:
    """The pads of the steps ahead, and of those proposed instead until the drone has answered."""
    needed = pads_of(planned, pad_gap_s=record.mission.margins.pad_gap_s)
    proposal = record.proposal
    if proposal is None:
        return needed
    gap_s = proposal.mission.margins.pad_gap_s
    return merged((*needed, *pads_of(proposal.steps, pad_gap_s=gap_s)))


async def give_back(watch: Watch, record: MissionRecord) -> None:
    """Hold what the mission still needs, and nothing else; a new need may be `Taken`."""
    known = await store.steps_of(watch.tx.connection, record.mission_id)
    planned = [each.step for each in known if each.status == "PLANNED"]
    await hold(watch.tx, record.mission_id, needed_pads(record, planned))
