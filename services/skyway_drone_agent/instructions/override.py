"""Overriding: an instruction that has priority over the drone's failsafe."""

from datetime import datetime

from skyway.contracts.instruction import AnyInstruction, DivertInstruction, ReturnHomeInstruction
from skyway_drone_agent.failsafes.failsafe import NEVER_OVERRIDDEN
from skyway_drone_agent.journal.escape import flight_resumed
from skyway_drone_agent.journal.logbook import Logbook, run_under_way
from skyway_drone_agent.journal.records import FailsafeOverridden
from skyway_drone_agent.vehicle import Vehicle


def overridden_by(
    instruction: AnyInstruction, logbook: Logbook, *, vehicle: Vehicle, now: datetime
) -> FailsafeOverridden | None:
    """The record to write before the instruction is judged; None when it overrides nothing.

    A turned flight continues from the drone's position to its planned end.
    """
    if not isinstance(instruction, DivertInstruction | ReturnHomeInstruction):
        return None
    mission = logbook.mission
    if not instruction.overrides_failsafe or mission is None:
        return None
    faults = tuple(fault for fault in logbook.faults if fault is not NEVER_OVERRIDDEN)
    run = run_under_way(logbook)
    if mission.escape is None or run is None:
        return FailsafeOverridden(faults=faults, at=now) if faults else None
    if mission.escape.fault is NEVER_OVERRIDDEN:
        return None
    sample = vehicle.sample(run, now)
    return FailsafeOverridden(
        faults=tuple(dict.fromkeys((mission.escape.fault, *faults))),
        at=now,
        flight=flight_resumed(mission.escape, here=sample.position),
        soc=sample.soc,
        used_j=(run.soc - sample.soc) * vehicle.model.battery_j,
    )
