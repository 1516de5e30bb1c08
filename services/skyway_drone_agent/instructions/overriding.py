"""Overriding: an instruction that tells a drone to do as it says, whatever its failsafe says."""

from datetime import datetime

from skyway.contracts.drone_health import Failsafe
from skyway.contracts.drone_report import RefusalCode
from skyway.contracts.instruction import AnyInstruction, DivertInstruction, ReturnHomeInstruction
from skyway_drone_agent.failsafes.failsafe import NEVER_OVERRIDDEN, Situation, severest
from skyway_drone_agent.instructions.refusal import Refusal
from skyway_drone_agent.journal.escape import flight_resumed
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.records import FailsafeOverridden
from skyway_drone_agent.journal.revision import Revision
from skyway_drone_agent.journal.under_way import run_under_way
from skyway_drone_agent.vehicles.vehicle import Vehicle

#: Failsafes that keep a drone on the ground.
_GROUNDED = (Failsafe.STAY, Failsafe.LAND_AT_NEXT)


def overridden_by(
    instruction: AnyInstruction, logbook: Logbook, *, vehicle: Vehicle, now: datetime
) -> FailsafeOverridden | None:
    """What is to be written before such an instruction is judged; None when it overrides nothing.

    A flight that was turned goes on, from where the drone is, to where it was to go first.
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


def failsafe_against(revision: Revision, logbook: Logbook) -> Refusal | None:
    """Why new steps are not for a drone whose failsafe acts; None when they may be."""
    mission = logbook.mission
    if mission is not None and mission.escape is not None:
        escape = mission.escape
        detail = f"{escape.failsafe.value} for {escape.fault.value} is under way"
        return Refusal(RefusalCode.FAILSAFE_ACTIVE, detail, {"fault": escape.fault.value})
    acting = severest(Situation.STANDING, logbook.faults) if mission is None else None
    if acting is None or acting[1] not in _GROUNDED:
        return None
    fault, failsafe = acting
    detail = f"{failsafe.value} for {fault.value}: the drone does not take off"
    return Refusal(RefusalCode.FAILSAFE_ACTIVE, detail, {"fault": fault.value})
