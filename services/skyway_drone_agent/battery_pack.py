"""The battery by its data sheet: cells, open-circuit voltage, inner resistance."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
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
    """Cells in series; `resistance_ohm` is that of the whole pack.

    Keep one instance: it computes the columns of its curve when it is made.
    """

    cells: int = 6
    resistance_ohm: float = 0.02
    curve: tuple[tuple[float, float], ...] = _LIPO_CURVE
    _socs: tuple[float, ...] = field(init=False, repr=False, compare=False)
    _volts: tuple[float, ...] = field(init=False, repr=False, compare=False)
    _slopes: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        socs = tuple(soc for soc, _ in self.curve)
        volts = tuple(self.cells * cell_v for _, cell_v in self.curve)
        rises = zip(pairwise(socs), pairwise(volts), strict=True)
        object.__setattr__(self, "_socs", socs)
        object.__setattr__(self, "_volts", volts)
        object.__setattr__(
            self, "_slopes", tuple((v_1 - v_0) / (s_1 - s_0) for (s_0, s_1), (v_0, v_1) in rises)
        )

    def open_voltage_v(self, soc: float) -> float:
        """The pack's voltage without a load."""
        return _along(self._socs, self._volts, soc)

    def soc_at_rest(self, open_voltage_v: float) -> float:
        """The charge that shows this voltage without a load, from 0 to 1."""
        return _along(self._volts, self._socs, open_voltage_v)

    def volts_per_soc(self, soc: float) -> float:
        """The slope of the pack's curve: in the flat middle a voltage says little."""
        after = bisect_right(self._socs, soc, 1, len(self._socs) - 1)
        return self._slopes[after - 1]

    def current_a(self, soc: float, power_w: float) -> float:
        """The current that gives this power; negative while charging.

        The lesser solution of power = (open voltage - resistance * current) * current.
        """
        open_v = self.open_voltage_v(soc)
        most_w = open_v * open_v / (4 * self.resistance_ohm)
        root = (open_v * open_v - 4 * self.resistance_ohm * min(power_w, most_w)) ** 0.5
        return float((open_v - root) / (2 * self.resistance_ohm))


def _along(xs: Sequence[float], ys: Sequence[float], x: float) -> float:
    """Straight between the points of a rising curve, flat beyond its ends."""
    if x <= xs[0]:
        return ys[0]
    if x >= xs[-1]:
        return ys[-1]
    after = bisect_right(xs, x)
    x_0, y_0 = xs[after - 1], ys[after - 1]
    return y_0 + (ys[after] - y_0) * (x - x_0) / (xs[after] - x_0)
