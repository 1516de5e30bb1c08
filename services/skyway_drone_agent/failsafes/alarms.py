"""Alarms: how bad a fault is, what it means, and the numbers behind it."""

from typing import Final

from skyway.contracts.drone_health import AlarmLevel, Failsafe, Fault
from skyway_drone_agent.analysis.analysis import Assessment

#: Level and meaning; a fault that is not here is known to the cloud without an alarm: its broker
#: tells it of a lost link, and the step that an expired instruction fails is an event by itself.
_ALARMS: Final[dict[Fault, tuple[AlarmLevel, str]]] = {
    Fault.BATTERY_EMPTY: ("CRITICAL", "no landing can be reached with the charge that is left"),
    Fault.MOTOR_FAILURE: ("CRITICAL", "a motor does not work"),
    Fault.BATTERY_SHORT: ("CRITICAL", "the charge does not safely take the drone where it goes"),
    Fault.BATTERY_HOT: ("URGENT", "the battery is too hot"),
    Fault.BATTERY_LOW: ("URGENT", "the drone will land below its reserve"),
    Fault.GEOFENCE: ("CRITICAL", "the drone is off its course"),
    Fault.GPS_LOST: ("CRITICAL", "the drone does not know where it is"),
    Fault.CLOUD_SILENT: ("WARNING", "the link is up, but nothing comes from the cloud"),
    Fault.DISK_FULL: ("CRITICAL", "the journal cannot be written, instructions are not taken"),
    Fault.PAD_OCCUPIED: ("WARNING", "something stands on the reserved pad"),
    Fault.BATTERY_COLD: ("WARNING", "the battery is cold and gives less than it holds"),
    Fault.CELL_IMBALANCE: ("WARNING", "the battery's cells are far apart"),
    Fault.BATTERY_WORN: ("WARNING", "the battery holds much less than when it was new"),
}

_HINTS: Final[dict[Failsafe, str]] = {
    Failsafe.GO_ON: "it goes on",
    Failsafe.WARN: "it goes on as planned",
    Failsafe.STAY: "it begins nothing until that is over",
    Failsafe.ASK: "it asks for another plan",
    Failsafe.WAIT_THEN_ASK: "it waits for a while, then it asks for another plan",
    Failsafe.LAND_AT_NEXT: "it takes off no more until that is over",
    Failsafe.DIVERT: "it flies to the nearest landing that it can reach, and waits there",
    Failsafe.LAND_NOW: "it lands where it is; somebody must fetch it",
}


def level_of(fault: Fault) -> AlarmLevel | None:
    """How bad that is; None when nobody needs an alarm for it."""
    return _ALARMS[fault][0] if fault in _ALARMS else None


def in_words(fault: Fault, failsafe: Failsafe) -> str:
    """What is wrong, and what the drone does about it."""
    meaning = _ALARMS[fault][1] if fault in _ALARMS else fault.value
    return f"{meaning}; {_HINTS[failsafe]}"


def numbers_behind(fault: Fault, assessment: Assessment, *, reserve_soc: float) -> dict[str, float]:
    """What was measured, and predicted, when the fault began."""
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
