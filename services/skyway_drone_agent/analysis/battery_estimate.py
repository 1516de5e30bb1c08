"""The charge of the battery: counted, and corrected by what the voltage says.

A Kalman filter of one number: what has been used is subtracted, the error of the counter grows
with it, and each voltage pulls as much as the curve is steep and the load is small.
"""

import math
from typing import Final

from skyway_drone_agent.analysis.resistance_estimate import ResistanceEstimate
from skyway_drone_agent.vehicles.battery_pack import BatteryPack
from skyway_drone_agent.vehicles.reading import Reading

#: Error of the counter, as a share of what it counts (the gain of a shunt).
_COUNTING_ERROR: Final = 0.03

#: How far a voltage may lie off the curve without a load: its sensor, warmth, and relaxation.
_VOLTAGE_ERROR_V: Final = 0.1

#: Seconds for which a voltage goes on being wrong in the same way, by its sensor and by a wrong
#: resistance: more readings within them say nothing new.
_ERROR_LASTS_S, _SAG_ERROR_LASTS_S = 60.0, 900.0

#: No estimate is better than this share of the charge, however often the voltage agrees.
_LEAST_ERROR: Final = 0.005

#: Charges that are closer together have one slope.
_SAME_CHARGE: Final = 1e-4

#: A counter that jumps by more than the whole battery has begun anew.
_MOST_USED: Final = 1.0

#: Error of a charge whose use could not be counted.
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
        """The pack's inner resistance, as seen whenever the load changed."""
        return self._resistance.ohm

    def take(self, reading: Reading, *, capacity_j: float, capacity_error: float) -> None:
        """Count what was used since the reading before, then hear what the voltage says.

        `capacity_error` is the standard deviation of the capacity, as a share of it.
        """
        if self._last is None:
            self._correct(reading, seconds=1.0)
        else:
            before, soc_before = self._last
            used = (reading.consumed_j - before.consumed_j) / capacity_j
            self._count(used, error=math.hypot(_COUNTING_ERROR, capacity_error))
            self._resistance.take(before, reading, soc_before=soc_before, soc=self.soc)
            self._correct(reading, seconds=(reading.at - before.at).total_seconds())
        self._last = (reading, self.soc)

    def _count(self, used: float, *, error: float) -> None:
        if abs(used) > _MOST_USED:
            self.error = max(self.error, _ERROR_WHEN_LOST)
            return
        self.soc = min(1.0, max(0.0, self.soc - used))
        # The counter errs in one direction, so that the deviations add up, not their squares.
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

        The curve's own slope would mislead: it is steep where an empty battery is believed in, so
        that a charge far off on the flat seems near and sure.
        """
        away = self._pack.soc_at_rest(open_v) - self.soc
        if abs(away) < _SAME_CHARGE:
            return self._pack.volts_per_soc(self.soc)
        return surprise_v / away
