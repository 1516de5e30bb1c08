"""The charge of the battery: counted, and corrected by the voltage.

A Kalman filter of one number. Used energy is subtracted, and the error of the estimate grows with
it. Each voltage corrects the estimate: more where the curve is steep, less under a high load.
"""

import math
from typing import Final

from skyway.contracts.flight_step import RechargeStep
from skyway.drone.charging import model_on_pad, soc_after_recharge
from skyway.drone.model import DroneModel
from skyway_drone_agent.analysis.leg import Leg
from skyway_drone_agent.vehicle import BatteryPack, Reading, StepRun

#: A change of current that shows the resistance through a voltage sensor's noise.
_LEAST_CHANGE_A: Final = 5.0

#: Standard deviation of the difference of two voltages.
_DIFFERENCE_ERROR_V: Final = 0.14

#: Error of the data sheet as a share of its value: age and cold double the resistance.
_FIRST_RESISTANCE_ERROR: Final = 1.0

#: The resistance changes with temperature, so its error never gets smaller.
_LEAST_RESISTANCE_ERROR: Final = 0.1

#: Limits of the resistance as multiples of the data sheet's value.
_LEAST_OF_RATED, _MOST_OF_RATED = 0.2, 10.0


class ResistanceEstimate:
    """The resistance of one pack; `error_ohm` is its standard deviation."""

    __slots__ = ("_pack", "_rated_ohm", "error_ohm", "ohm")

    def __init__(self, pack: BatteryPack) -> None:
        self._pack = pack
        self._rated_ohm = self.ohm = pack.resistance_ohm
        self.error_ohm = _FIRST_RESISTANCE_ERROR * pack.resistance_ohm

    def update(self, before: Reading, after: Reading, *, soc_before: float, soc: float) -> None:
        """Learn from two readings between which the load changed."""
        change_a = after.current_a - before.current_a
        if abs(change_a) < _LEAST_CHANGE_A:
            return
        by_charge_v = self._pack.open_voltage_v(soc) - self._pack.open_voltage_v(soc_before)
        seen_ohm = (by_charge_v - (after.voltage_v - before.voltage_v)) / change_a
        noise_ohm = _DIFFERENCE_ERROR_V / abs(change_a)
        variance = self.error_ohm * self.error_ohm
        gain = variance / (variance + noise_ohm * noise_ohm)
        ohm = self.ohm + gain * (seen_ohm - self.ohm)
        self.ohm = min(
            _MOST_OF_RATED * self._rated_ohm, max(_LEAST_OF_RATED * self._rated_ohm, ohm)
        )
        error_ohm = (variance * (1.0 - gain)) ** 0.5
        self.error_ohm = max(_LEAST_RESISTANCE_ERROR * self._rated_ohm, error_ohm)


#: Error of the counter, as a share of what it counts (the gain of a shunt).
_COUNTING_ERROR: Final = 0.03

#: Error of a voltage without load: by the sensor, temperature and relaxation.
_VOLTAGE_ERROR_V: Final = 0.1

#: Seconds for which the error of a voltage (sensor, wrong resistance) stays the same: more readings
#: in this time give no new information.
_ERROR_LASTS_S, _SAG_ERROR_LASTS_S = 60.0, 900.0

#: The least error of the estimate, however often the voltage agrees.
_LEAST_ERROR: Final = 0.005

#: Charges closer than this have the same slope.
_SAME_CHARGE: Final = 1e-4

#: A counter that jumps by more than the whole battery was reset.
_MOST_USED: Final = 1.0

#: Error of the charge after energy use that was not counted.
_ERROR_WHEN_LOST: Final = 0.3


class BatteryEstimate:
    """The state of charge of one battery; `error` is its standard deviation."""

    __slots__ = ("_last", "_pack", "_resistance", "error", "soc")

    def __init__(self, pack: BatteryPack, *, soc: float, error: float) -> None:
        self.soc = soc
        self.error = error
        self._pack = pack
        self._resistance = ResistanceEstimate(pack)
        self._last: tuple[Reading, float] | None = None

    @property
    def resistance_ohm(self) -> float:
        """The pack's inner resistance, estimated at changes of the load."""
        return self._resistance.ohm

    def update(self, reading: Reading, *, capacity_j: float, capacity_error: float) -> None:
        """Count the energy used since the last reading, then correct by the voltage.

        `capacity_error` is the standard deviation of the capacity, as a share of it.
        """
        if self._last is None:
            self._correct(reading, seconds=1.0)
        else:
            before, soc_before = self._last
            used = (reading.consumed_j - before.consumed_j) / capacity_j
            self._count(used, error=math.hypot(_COUNTING_ERROR, capacity_error))
            self._resistance.update(before, reading, soc_before=soc_before, soc=self.soc)
            if reading.has_battery:
                self._correct(reading, seconds=(reading.at - before.at).total_seconds())
        self._last = (reading, self.soc)

    def _count(self, used: float, *, error: float) -> None:
        if abs(used) > _MOST_USED:
            self.error = max(self.error, _ERROR_WHEN_LOST)
            return
        self.soc = min(1.0, max(0.0, self.soc - used))
        # The counter errs in one direction, so the deviations add up, not their squares.
        self.error += error * abs(used)

    def _correct(self, reading: Reading, *, seconds: float) -> None:
        if seconds <= 0.0:
            return
        soc = self.soc
        open_v = reading.voltage_v + reading.current_a * self._resistance.ohm
        surprise_v = open_v - self._pack.open_voltage_v(soc)
        steepness = self._steepness(open_v, surprise_v)
        sag_error_v = reading.current_a * self._resistance.error_ohm
        noise = _VOLTAGE_ERROR_V * _VOLTAGE_ERROR_V * max(1.0, _ERROR_LASTS_S / seconds)
        noise += sag_error_v * sag_error_v * max(1.0, _SAG_ERROR_LASTS_S / seconds)
        variance = self.error * self.error
        gain = variance * steepness / (variance * steepness * steepness + noise)
        self.soc = min(1.0, max(0.0, soc + gain * surprise_v))
        self.error = max(_LEAST_ERROR, (variance * (1.0 - gain * steepness)) ** 0.5)

    def _steepness(self, open_v: float, surprise_v: float) -> float:
        """Volts per charge between the estimate and what this voltage shows.

        The slope of the curve at the estimate would mislead: it is steep near an empty battery, so
        a charge far away on the flat part would seem near and precise.
        """
        away = self._pack.soc_at_rest(open_v) - self.soc
        if abs(away) < _SAME_CHARGE:
            return self._pack.volts_per_soc(self.soc)
        return surprise_v / away


#: Error of the charge that the journal holds.
_JOURNAL_ERROR: Final = 0.02

#: Error of the energy that a step under way has used or charged, as a share.
_PLAN_ERROR: Final = 0.25


def first_charge(
    reading: Reading,
    run: StepRun | None,
    leg: Leg | None,
    *,
    model: DroneModel,
    soc: float,
    capacity_j: float,
) -> tuple[float, float]:
    """The first charge and its standard deviation, for a logbook that says `soc`.

    An agent that restarts in the middle of a step has not counted the energy used before.
    """
    by_now = soc
    if run is not None:
        elapsed_s = max(0.0, (reading.at - run.started_at).total_seconds())
        if leg is not None:
            by_now = soc - _used_j(reading, leg, elapsed_s, model=model) / capacity_j
        elif isinstance(run.step, RechargeStep) and soc < run.step.until_soc:
            on_curve = max(soc, model.charge_curve[0].soc)
            charging = model_on_pad(model, run.step.power_w)
            by_now = min(run.step.until_soc, soc_after_recharge(charging, on_curve, elapsed_s))
    by_now = min(1.0, max(0.0, by_now))
    return by_now, _JOURNAL_ERROR + _PLAN_ERROR * abs(by_now - soc)


def _used_j(reading: Reading, leg: Leg, elapsed_s: float, *, model: DroneModel) -> float:
    """The energy of the flight so far by the model, and of the landing if it has begun.

    Energy depends on time, not on distance: against the wind the same way takes much more.
    """
    still_s = leg.step.length_m / leg.speed_mps
    power_w = leg.flight_j / still_s
    if leg.is_on_the_way(reading):
        return power_w * elapsed_s
    # A landing takes at most `stop_s`: the remaining time was the way.
    way_s = max(min(still_s, elapsed_s), elapsed_s - model.stop_s)
    landing_s = elapsed_s - way_s
    return power_w * way_s + leg.stop_j * min(1.0, landing_s / max(model.stop_s, 1.0))
