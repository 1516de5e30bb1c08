"""Faults: the symptom of each, how long it must last, when it ends, and its alarm."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from skyway.contracts.drone_report import AlarmLevel, Failsafe, Fault
from skyway_drone_agent.analysis.analysis import Assessment
from skyway_drone_agent.failsafes.failsafe import Situation, in_order_of_danger

#: A fault begins when a predicted charge is this much below its limit, and ends when it is this
#: much above.
SOC_MARGIN: Final = 0.005

#: Rounding of a predicted charge: plans may land with exactly what they must keep.
_SOC_ROUNDING: Final = 0.001

#: If the drone cannot land anywhere with this charge, it lands on the spot. Half the reserve counts
#: if that is less.
EMPTY_SOC: Final = 0.02

#: Another landing is better when it leaves this much more charge.
_BETTER_BY_SOC: Final = 0.02

#: Metres off the leg: half the width of a usual corridor, twenty times a good GPS's error.
OFF_COURSE_M, BACK_ON_COURSE_M = 200.0, 150.0

#: Degrees C: lithium-polymer packs age fast above, and swell not far from there.
HOT_C, COOLED_C = 60.0, 55.0

#: Degrees C: below freezing a cell gives much less of its charge.
COLD_C, WARMED_C = 0.0, 3.0

#: Volts between the best and the worst cell.
IMBALANCED_V, BALANCED_V = 0.10, 0.07

#: Share of the capacity when new at which packs are usually replaced.
WORN_HEALTH, GOOD_HEALTH = 0.80, 0.82

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
    Fault.BATTERY_UNKNOWN: ("CRITICAL", "nothing reports the charge of the battery"),
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
    Failsafe.DIVERT: "the drone flies to a safe landing and waits there",
    Failsafe.LAND_NOW: "the drone lands on the spot, and people must fetch it",
}


@dataclass(frozen=True, slots=True)
class Signs:
    """The values that show whether there is a fault."""

    assessment: Assessment
    situation: Situation
    reserve_soc: float
    is_link_lost: bool = False
    is_cloud_silent: bool = False
    is_disk_full: bool = False
    is_expired: bool = False

    @property
    def soc_at_landing(self) -> float:
        """The charge at the end of the released flights; above every limit on the ground."""
        landing = self.assessment.landing
        return landing.soc_at_landing if landing and self._is_flying else 2.0

    @property
    def best_soc(self) -> float:
        """The most charge that is left at a landing in reach; -1 if none is in reach."""
        in_reach = self.assessment.landings_in_reach
        return max((one.soc_at_landing for one in in_reach), default=-1.0)

    @property
    def _is_flying(self) -> bool:
        return self.situation is Situation.FLYING


@dataclass(frozen=True, slots=True)
class Symptom:
    """A fault begins when `shows` held for `lasts_s` fleet seconds; it ends without `lingers`."""

    shows: Callable[[Signs], bool]
    lingers: Callable[[Signs], bool]
    lasts_s: float


def empty_soc(reserve_soc: float) -> float:
    """The least charge at a landing: with less at every landing a drone lands on the spot."""
    return min(EMPTY_SOC, reserve_soc / 2) - _SOC_ROUNDING


def _is_low(signs: Signs) -> bool:
    return signs.soc_at_landing < signs.reserve_soc - SOC_MARGIN


def _is_not_high(signs: Signs) -> bool:
    return signs.soc_at_landing < signs.reserve_soc + SOC_MARGIN


def _is_short(signs: Signs) -> bool:
    return (
        signs.soc_at_landing < signs.reserve_soc / 2 - _SOC_ROUNDING
        and signs.best_soc >= signs.soc_at_landing + _BETTER_BY_SOC
    )


def _is_empty(signs: Signs) -> bool:
    least_soc = empty_soc(signs.reserve_soc)
    return signs.soc_at_landing < least_soc and signs.best_soc < least_soc


def _same(shows: Callable[[Signs], bool], lasts_s: float) -> Symptom:
    return Symptom(shows, shows, lasts_s)


SYMPTOMS: Final[dict[Fault, Symptom]] = {
    Fault.BATTERY_EMPTY: _same(_is_empty, 5.0),
    Fault.MOTOR_FAILURE: _same(lambda signs: not signs.assessment.motors_work, 0.0),
    Fault.BATTERY_SHORT: _same(_is_short, 5.0),
    Fault.BATTERY_HOT: Symptom(
        lambda signs: signs.assessment.temperature_c > HOT_C,
        lambda signs: signs.assessment.temperature_c > COOLED_C,
        10.0,
    ),
    Fault.BATTERY_LOW: Symptom(_is_low, _is_not_high, 5.0),
    Fault.GEOFENCE: Symptom(
        lambda signs: signs.assessment.has_gps and signs.assessment.off_course_m > OFF_COURSE_M,
        lambda signs: signs.assessment.off_course_m > BACK_ON_COURSE_M,
        5.0,
    ),
    Fault.GPS_LOST: _same(lambda signs: not signs.assessment.has_gps, 30.0),
    Fault.BATTERY_UNKNOWN: _same(lambda signs: not signs.assessment.has_battery, 5.0),
    Fault.LINK_LOST: _same(lambda signs: signs.is_link_lost, 0.0),
    Fault.CLOUD_SILENT: _same(lambda signs: signs.is_cloud_silent, 0.0),
    Fault.DISK_FULL: _same(lambda signs: signs.is_disk_full, 0.0),
    Fault.PAD_OCCUPIED: _same(
        lambda signs: signs.situation is Situation.RECHARGING and not signs.assessment.pad_is_free,
        0.0,
    ),
    Fault.INSTRUCTION_EXPIRED: _same(lambda signs: signs.is_expired, 0.0),
    Fault.BATTERY_COLD: Symptom(
        lambda signs: signs.assessment.temperature_c < COLD_C,
        lambda signs: signs.assessment.temperature_c < WARMED_C,
        30.0,
    ),
    Fault.CELL_IMBALANCE: Symptom(
        lambda signs: signs.assessment.cell_spread_v > IMBALANCED_V,
        lambda signs: signs.assessment.cell_spread_v > BALANCED_V,
        30.0,
    ),
    Fault.BATTERY_WORN: Symptom(
        lambda signs: signs.assessment.state_of_health < WORN_HEALTH,
        lambda signs: signs.assessment.state_of_health < GOOD_HEALTH,
        60.0,
    ),
}


class FaultMonitor:
    """Remembers the current faults, and since when other symptoms show."""

    __slots__ = ("_faults", "_shown_since")

    def __init__(self, faults: Iterable[Fault]) -> None:
        self._faults = frozenset(faults)
        self._shown_since: dict[Fault, datetime] = {}

    def update(self, signs: Signs) -> tuple[Fault, ...]:
        """The current faults after these signs, the most dangerous first."""
        at = signs.assessment.at
        self._shown_since = {
            fault: self._shown_since.get(fault, at)
            for fault, symptom in SYMPTOMS.items()
            if symptom.shows(signs)
        }
        lingering = {fault for fault in self._faults if SYMPTOMS[fault].lingers(signs)}
        begun = {
            fault
            for fault, since in self._shown_since.items()
            if fault not in self._faults and (at - since).total_seconds() >= SYMPTOMS[fault].lasts_s
        }
        self._faults = frozenset(lingering | begun)
        return in_order_of_danger(self._faults)


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
