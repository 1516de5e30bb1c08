"""The failsafes: what a drone does by itself, for every situation and every fault.

The faults stand in the order of danger. Of several failsafes the severest acts. Of equally severe
failsafes the one with the more dangerous fault acts. `docs/failsafes.md` shows this table. People
may override a failsafe with an instruction.
"""

from collections.abc import Iterable
from datetime import datetime
from enum import IntEnum
from typing import Final

from skyway.contracts.drone_report import ActiveFailsafe, Failsafe, Fault
from skyway.contracts.flight_step import FlyStep, end_of
from skyway.contracts.instruction import AnyInstruction, DivertInstruction, ReturnHomeInstruction
from skyway.ids import StationId
from skyway_drone_agent.journal.logbook import Logbook, run_under_way
from skyway_drone_agent.journal.mission_changes import flight_resumed
from skyway_drone_agent.journal.records import FailsafeOverridden
from skyway_drone_agent.vehicle import Vehicle


class Situation(IntEnum):
    """What a drone is doing; the columns of the table."""

    STANDING = 0
    LOADING = 1
    WAITING = 2
    RECHARGING = 3
    DELIVERING = 4
    FLYING = 5
    DOWN = 6


_GO, _WARN, _STAY, _ASK = Failsafe.GO_ON, Failsafe.WARN, Failsafe.STAY, Failsafe.ASK
_WAIT, _NEXT = Failsafe.WAIT_THEN_ASK, Failsafe.LAND_AT_NEXT
_TURN, _DOWN = Failsafe.DIVERT, Failsafe.LAND_NOW

# fmt: off
TABLE: Final[dict[Fault, tuple[Failsafe, ...]]] = {
    #                          STANDING LOADING WAITING RECHARG. DELIVER. FLYING  DOWN
    Fault.BATTERY_EMPTY:       (_GO,    _GO,    _GO,    _GO,     _GO,     _DOWN,  _GO),
    Fault.MOTOR_FAILURE:       (_NEXT,  _NEXT,  _NEXT,  _NEXT,   _NEXT,   _DOWN,  _GO),
    Fault.BATTERY_SHORT:       (_GO,    _GO,    _GO,    _GO,     _GO,     _TURN,  _GO),
    Fault.BATTERY_HOT:         (_STAY,  _STAY,  _STAY,  _STAY,   _STAY,   _WARN,  _WARN),
    Fault.BATTERY_LOW:         (_GO,    _GO,    _GO,    _GO,     _GO,     _WARN,  _GO),
    Fault.GEOFENCE:            (_GO,    _GO,    _GO,    _GO,     _GO,     _TURN,  _GO),
    Fault.GPS_LOST:            (_NEXT,  _NEXT,  _NEXT,  _NEXT,   _NEXT,   _DOWN,  _GO),
    Fault.BATTERY_UNKNOWN:     (_NEXT,  _NEXT,  _NEXT,  _NEXT,   _NEXT,   _NEXT,  _GO),
    Fault.LINK_LOST:           (_NEXT,  _NEXT,  _NEXT,  _NEXT,   _NEXT,   _NEXT,  _GO),
    Fault.CLOUD_SILENT:        (_NEXT,  _NEXT,  _NEXT,  _NEXT,   _NEXT,   _NEXT,  _GO),
    Fault.DISK_FULL:           (_STAY,  _STAY,  _STAY,  _STAY,   _STAY,   _NEXT,  _WARN),
    Fault.PAD_OCCUPIED:        (_GO,    _GO,    _GO,    _WAIT,   _GO,     _GO,    _GO),
    Fault.INSTRUCTION_EXPIRED: (_ASK,   _GO,    _GO,    _GO,     _GO,     _GO,    _GO),
    Fault.BATTERY_COLD:        (_WARN,  _WARN,  _WARN,  _WARN,   _WARN,   _WARN,  _GO),
    Fault.CELL_IMBALANCE:      (_WARN,  _WARN,  _WARN,  _WARN,   _WARN,   _WARN,  _GO),
    Fault.BATTERY_WORN:        (_WARN,  _WARN,  _WARN,  _WARN,   _WARN,   _WARN,  _GO),
}
# fmt: on

#: No instruction overrides this fault: the drone has no energy left to fly with.
NEVER_OVERRIDDEN: Final = Fault.BATTERY_EMPTY

_DANGER: Final = {fault: place for place, fault in enumerate(TABLE)}
_SEVERITY: Final = {failsafe: place for place, failsafe in enumerate(Failsafe)}

_SITUATION_OF_STEP: Final = {
    "PICK_UP": Situation.LOADING,
    "FLY": Situation.FLYING,
    "WAIT": Situation.WAITING,
    "RECHARGE": Situation.RECHARGING,
    "DELIVER": Situation.DELIVERING,
    "RETURN": Situation.DELIVERING,
}


def failsafe_for(situation: Situation, fault: Fault) -> Failsafe:
    """What the drone does about this fault in this situation."""
    return TABLE[fault][situation]


def severest(situation: Situation, faults: Iterable[Fault]) -> tuple[Fault, Failsafe] | None:
    """The fault and the failsafe that acts; None when no fault matters in this situation."""
    acting = [
        (fault, failsafe)
        for fault in faults
        if (failsafe := failsafe_for(situation, fault)) is not Failsafe.GO_ON
    ]
    return min(acting, key=lambda one: (-_SEVERITY[one[1]], _DANGER[one[0]]), default=None)


def is_severer(failsafe: Failsafe, than: Failsafe) -> bool:
    """Whether the first goes further than the second."""
    return _SEVERITY[failsafe] > _SEVERITY[than]


def in_order_of_danger(faults: Iterable[Fault]) -> tuple[Fault, ...]:
    """The faults, the most dangerous first."""
    return tuple(sorted(faults, key=_DANGER.__getitem__))


def not_ignored(faults: Iterable[Fault], logbook: Logbook) -> tuple[Fault, ...]:
    """The faults without those that people have overridden in this mission."""
    ignored = logbook.mission.ignored_faults if logbook.mission else ()
    return tuple(fault for fault in faults if fault not in ignored)


def situation_of(logbook: Logbook) -> Situation:
    """What the drone is doing."""
    if logbook.is_down:
        return Situation.DOWN
    step = logbook.mission.step_under_way if logbook.mission else None
    if step is not None:
        return _SITUATION_OF_STEP[step.kind]
    return Situation.FLYING if logbook.is_airborne else Situation.STANDING


def active_failsafe(logbook: Logbook) -> ActiveFailsafe | None:
    """The failsafe that acts and its destination; None while the drone follows its plan."""
    mission = logbook.mission
    if mission is None:
        return None
    if mission.escape is not None:
        fault, failsafe = mission.escape.fault, mission.escape.failsafe
    else:
        faults = [fault for fault in logbook.faults if fault not in mission.ignored_faults]
        acting = severest(situation_of(logbook), faults)
        if acting is None or not is_severer(acting[1], Failsafe.WARN):
            return None
        fault, failsafe = acting
    station_id = None if failsafe is Failsafe.LAND_NOW else _next_stand(logbook)
    return ActiveFailsafe(fault=fault, failsafe=failsafe, station_id=station_id)


def _next_stand(logbook: Logbook) -> StationId | None:
    """The station where the drone stands or lands next."""
    if logbook.station_id is not None or logbook.mission is None:
        return logbook.station_id
    flights = (step for step in logbook.mission.steps if isinstance(step, FlyStep) and step.lands)
    return next((end_of(step) for step in flights), None)


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
