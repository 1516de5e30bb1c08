"""What plans are made with on top of what flights should take: the network's energy margin.

A drone that was found to use more than that, in headwind or with a worn battery, is planned for
with what it uses.
"""

import math
from functools import lru_cache
from typing import Final

from skyway.drone.model import DroneModel

#: A drone that uses so little more than its model says is within what its sensors err: it judges
#: its plans by the model alone, and so do we.
_AS_PLANNED_FACTOR: Final = 1.02

#: Drones report no larger factor; beyond it something else is wrong.
_LARGEST_FACTOR: Final = 4.0

#: Plans have this much more than was measured, in so many steps: gusts come and go, and a plan that
#: a drone has taken should not be too little for it a minute later. Our own choice.
_HEADROOM, _STEPS = 0.02, 20


@lru_cache(maxsize=1_000)
def with_margin(model: DroneModel, energy_margin: float) -> DroneModel:
    """The model as it is planned with: every flight takes `energy_margin` more, as a share.

    Only problems hold such a model. Whoever compares a drone with its plan, or asks for another
    plan, needs the true one, else the margin is added twice.
    """
    power_w = model.power_empty_w * (1 + energy_margin)
    return model.model_copy(update={"power_empty_w": power_w})


def used_more(consumption_factor: float) -> float:
    """What a drone's flights take more than its model says, in hundredths, 0 if hardly any more."""
    if consumption_factor <= _AS_PLANNED_FACTOR:
        return 0.0
    return round(min(consumption_factor, _LARGEST_FACTOR) - 1, 2)


def planned_more(consumption_factor: float) -> float:
    """The same for plans that the drone is to fly: a little more, in steps."""
    more = used_more(consumption_factor)
    return math.ceil((more + _HEADROOM) * _STEPS) / _STEPS if more > 0 else 0.0
