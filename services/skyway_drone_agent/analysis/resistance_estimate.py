"""The battery's inner resistance: how far the voltage falls when the load rises."""

from typing import Final

from skyway_drone_agent.vehicles.battery_pack import BatteryPack
from skyway_drone_agent.vehicles.reading import Reading

#: A change of current that shows the resistance through a voltage sensor's noise.
_LEAST_CHANGE_A: Final = 5.0

#: Error of a difference of two voltages.
_VOLTAGE_ERROR_V: Final = 0.14

#: What the maker says may be wrong by so much of it: age and cold double it.
_FIRST_ERROR: Final = 1.0

#: It changes with the warmth, so it is never known better than so.
_LEAST_ERROR: Final = 0.1

#: Between these times the maker's.
_LEAST, _MOST = 0.2, 10.0


class ResistanceEstimate:
    """The resistance of one pack; `error_ohm` is its standard deviation."""

    __slots__ = ("_pack", "_rated_ohm", "error_ohm", "ohm")

    def __init__(self, pack: BatteryPack) -> None:
        self._pack = pack
        self._rated_ohm = self.ohm = pack.resistance_ohm
        self.error_ohm = _FIRST_ERROR * pack.resistance_ohm

    def take(self, before: Reading, after: Reading, *, soc_before: float, soc: float) -> None:
        """Learn from two readings between which the load changed."""
        change_a = after.current_a - before.current_a
        if abs(change_a) < _LEAST_CHANGE_A:
            return
        by_charge_v = self._pack.open_voltage_v(soc) - self._pack.open_voltage_v(soc_before)
        seen_ohm = (by_charge_v - (after.voltage_v - before.voltage_v)) / change_a
        noise_ohm = _VOLTAGE_ERROR_V / abs(change_a)
        variance = self.error_ohm * self.error_ohm
        gain = variance / (variance + noise_ohm * noise_ohm)
        ohm = self.ohm + gain * (seen_ohm - self.ohm)
        self.ohm = min(_MOST * self._rated_ohm, max(_LEAST * self._rated_ohm, ohm))
        error_ohm = (variance * (1.0 - gain)) ** 0.5
        self.error_ohm = max(_LEAST_ERROR * self._rated_ohm, error_ohm)
