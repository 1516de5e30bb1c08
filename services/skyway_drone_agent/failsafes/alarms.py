"""Alarms: how bad a fault is, what it means, and the numbers behind it."""

from typing import Final

from skyway.contracts.drone_health import AlarmLevel, Failsafe, Fault
from skyway_drone_agent.analysis.analysis import Assessment

#: Level and meaning of each fault. The cloud needs no alarm for the other faults: the broker
#: reports a lost link, and an expired instruction fails a step, which is an event of its own.
_ALARMS: Final[dict[Fault, tuple[AlarmLevel, str]]] = {
    Fault.BATTERY_EMPTY: ("CRITICAL", "no landing can be reached with the charge that is left"),
    Fault.MOTOR_FAILURE: ("CRITICAL", "a motor does not work"),
    Fault.BATTERY_SHORT: ("CRITICAL", "the charge may not reach the next landing"),
    Fault.BATTERY_HOT: ("URGENT", "the battery is too hot"),
    Fault.BATTERY_LOW: ("URGENT", "the drone will land below its reserve"),
    Fault.GEOFENCE: ("CRITICAL", "the drone is off its course"),
    Fault.GPS_LOST: ("CRITICAL", "the position of the drone is unknown"),
    Fault.CLOUD_SILENT: ("WARNING", "the link is up, but nothing comes from the cloud"),
    Fault.DISK_FULL: ("CRITICAL", "the journal cannot be written, so no instruction is accepted"),
    Fault.PAD_OCCUPIED: ("WARNING", "another drone stands on the reserved pad"),
    Fault.BATTERY_COLD: ("WARNING", "the battery is cold and gives less than it holds"),
    Fault.CELL_IMBALANCE: ("WARNING", "the battery's cells are far apart"),
    Fault.BATTERY_WORN: ("WARNING", "the battery holds much less than when it was new"),
}

_HINTS: Final[dict[Failsafe, str]] = {
    Failsafe.GO_ON: "the drone goes on",
    Failsafe.WARN: "the drone goes on as planned",
    Failsafe.STAY: "the drone begins no step until the fault ends",
    Failsafe.ASK: "the drone asks for another plan",
    Failsafe.WAIT_THEN_ASK: "the drone waits for a while, then it asks for another plan",
    Failsafe.LAND_AT_NEXT: "the drone does not take off until the fault ends",
    Failsafe.DIVERT: "the drone flies to the nearest landing in reach and waits there",
    Failsafe.LAND_NOW: "the drone lands on the spot, and people must fetch it",
}


def level_of(fault: Fault) -> AlarmLevel | None:
    """The alarm level of a fault; None when the fault needs no alarm."""
    return _ALARMS[fault][0] if fault in _ALARMS else None


def in_words(fault: Fault, failsafe: Failsafe) -> str:
    """A sentence on the fault and on what the drone does about it."""
    meaning = _ALARMS[fault][1] if fault in _ALARMS else fault.value
    return f"{meaning}; {_HINTS[failsafe]}"


def numbers_behind(fault: Fault, assessment: Assessment, *, reserve_soc: float) -> dict[str, float]:
    """The measured and predicted numbers when the fault began."""
    numbers: dict[str, float] = {"soc": round(assessment.soc, 4)}
    match fault:
        case Fault.BATTERY_EMPTY | Fault.BATTERY_SHORT | Fault.BATTERY_LOW:
            numbers |= {"reserve_soc": reserve_soc, "range_m": round(assessment.range_m)}
            if assessment.landing is not None:
                numbers["soc_at_landing"] = round(assessment.landing.soc_at_landing, 4)
                numbers["need_j"] = round(assessment.landing.need_j)
        case Fault.BATTERY_HOT | Fault.BATTERY_COLD:
            numbers["temperature_c"] = round(assessment.temperature_c, 1)
        case Fault.GEOFENCE:
            numbers["off_course_m"] = round(assessment.off_course_m)
        case Fault.CELL_IMBALANCE:
            numbers["cell_spread_v"] = round(assessment.cell_spread_v, 3)
        case Fault.BATTERY_WORN:
            numbers["state_of_health"] = round(assessment.state_of_health, 3)
        case _:
            pass
    return numbers
