"""The battery as its makers describe it: cells, their open-circuit voltage, inner resistance."""

from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

#: Open-circuit voltage of a lithium-polymer cell by state of charge: a rounded discharge curve at
#: 25 degrees C, strictly rising.
_LIPO_CURVE: Final = (
    (0.00, 3.27),
    (0.05, 3.61),
    (0.10, 3.69),
    (0.20, 3.73),
    (0.30, 3.77),
    (0.40, 3.80),
    (0.50, 3.84),
    (0.60, 3.87),
    (0.70, 3.95),
    (0.80, 4.02),
    (0.90, 4.11),
    (1.00, 4.20),
)


@dataclass(frozen=True, slots=True)
class BatteryPack:
    """Cells in series; `resistance_ohm` is that of the whole pack."""

    cells: int = 6
    resistance_ohm: float = 0.02
    curve: tuple[tuple[float, float], ...] = _LIPO_CURVE

    def open_voltage_v(self, soc: float) -> float:
        """The pack's voltage without a load."""
        return self.cells * _along(self.curve, soc)

    def soc_at_rest(self, open_voltage_v: float) -> float:
        """The charge that shows this voltage without a load, from 0 to 1."""
        inverse = tuple((volts, soc) for soc, volts in self.curve)
        return _along(inverse, open_voltage_v / self.cells)

    def volts_per_soc(self, soc: float) -> float:
        """How steep the pack's curve is: on its flat middle a voltage says little."""
        for (soc_0, volts_0), (soc_1, volts_1) in pairwise(self.curve):
            if soc <= soc_1:
                return self.cells * (volts_1 - volts_0) / (soc_1 - soc_0)
        return self.volts_per_soc(1.0)

    def current_a(self, soc: float, power_w: float) -> float:
        """The current that gives this power; negative while charging.

        The lesser solution of power = (open voltage - resistance * current) * current.
        """
        open_v = self.open_voltage_v(soc)
        most_w = open_v * open_v / (4 * self.resistance_ohm)
        root = (open_v * open_v - 4 * self.resistance_ohm * min(power_w, most_w)) ** 0.5
        return float((open_v - root) / (2 * self.resistance_ohm))


def _along(curve: tuple[tuple[float, float], ...], x: float) -> float:
    """Straight between the points of a rising curve, flat beyond its ends."""
    if x <= curve[0][0]:
        return curve[0][1]
    if x >= curve[-1][0]:
        return curve[-1][1]
    after = bisect_right(curve, (x, float("inf")))
    (x_0, y_0), (x_1, y_1) = curve[after - 1], curve[after]
    return y_0 + (y_1 - y_0) * (x - x_0) / (x_1 - x_0)
