"""The charge curves of a drone on pads of different powers, as the arrays that the kernels read."""

from typing import NamedTuple

import numpy as np

from skyway.drone.charging import model_on_pad
from skyway.drone.model import DroneModel
from skyway.network.pad_power import PadPowers
from skyway.planner.kernels.memory import Floats, Longs


class Curves(NamedTuple):
    """The charge curves of a drone one after another, see `Task`."""

    offsets: Longs
    seconds: Floats
    joules: Floats


def curves_of(model: DroneModel, powers: PadPowers) -> Curves:
    """The charge curves on pads of these powers, in the order of the powers."""
    joules = np.array([point.soc * model.battery_j for point in model.charge_curve], np.float64)
    seconds: list[Floats] = []
    for power_w in powers.steps_w:
        times_s = [point.time_s for point in model_on_pad(model, power_w).charge_curve]
        # A gap between two curves, so that each position belongs to one curve.
        begins_s = seconds[-1][-1] + 1.0 if seconds else 0.0
        seconds.append(np.array(times_s, np.float64) + begins_s)
    return Curves(
        np.arange(len(seconds) + 1, dtype=np.int64) * len(joules),
        np.concatenate(seconds),
        np.tile(joules, len(seconds)),
    )
