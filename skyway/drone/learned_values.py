"""What the flights of one drone have shown about it, and its model with these values."""

import math
from functools import lru_cache
from typing import Annotated, Final, Self

from pydantic import Field

from skyway.drone.charging import cold_charging_factor
from skyway.drone.model import ChargePoint, DroneModel
from skyway.json_model import WireModel

#: The bounds of each value. Beyond them something else is wrong with the drone, and a person has to
#: look. Our own choice.
STILL_AIR_BOUNDS: Final = (0.8, 1.6)
HEALTH_BOUNDS: Final = (0.5, 1.0)
CHARGE_RATE_BOUNDS: Final = (0.3, 1.2)
DEVIATION_BOUNDS: Final = (0.02, 0.26)

#: Standard deviation of the energy use in still air of a drone that has not flown yet, as a share:
#: drones of one model differ, and so do their flights. Our own choice.
UNKNOWN_USE: Final = 0.08

#: Deviations are rounded up to whole multiples of 1 / this.
_DEVIATION_STEPS: Final = 50

#: Plans use the values in steps of 1 / this, so that many drones of a model share theirs. A value
#: between two steps counts as the worse one, unless it is that near to the better one: a session on
#: a pad that is planned too short costs another plan.
_STEPS: Final = 20
_NEAR: Final = 0.02

#: Within these limits a `DroneModel` is valid.
_LEAST_BATTERY_J, _MOST_POWER_W, _MOST_TIME_S = 1.0, 1e9, 1e9


class LearnedValues(WireModel):
    """One drone against its model; the first three are 1 for a drone that is as its model says."""

    still_air_factor: Annotated[
        float,
        Field(
            ge=STILL_AIR_BOUNDS[0],
            le=STILL_AIR_BOUNDS[1],
            description="Energy that its flights use in still air, divided by the model's.",
            examples=[1.1],
        ),
    ] = 1.0
    state_of_health: Annotated[
        float,
        Field(
            ge=HEALTH_BOUNDS[0],
            le=HEALTH_BOUNDS[1],
            description="Energy that its full battery holds, divided by the model's.",
            examples=[0.9],
        ),
    ] = 1.0
    charge_rate_factor: Annotated[
        float,
        Field(
            ge=CHARGE_RATE_BOUNDS[0],
            le=CHARGE_RATE_BOUNDS[1],
            description="How fast its state of charge rises on a pad, divided by the model's.",
            examples=[0.85],
        ),
    ] = 1.0
    still_air_deviation: Annotated[
        float,
        Field(
            ge=DEVIATION_BOUNDS[0],
            le=DEVIATION_BOUNDS[1],
            description="Standard deviation of `still_air_factor` from flight to flight. Margins "
            "that follow from a risk use it.",
            examples=[0.06],
        ),
    ] = UNKNOWN_USE

    @classmethod
    def in_steps(
        cls,
        *,
        still_air_factor: float,
        state_of_health: float,
        charge_rate_factor: float,
        still_air_deviation: float = UNKNOWN_USE,
    ) -> Self:
        """These values within their bounds, and rounded to the worse step."""
        deviation = math.ceil(round(still_air_deviation * _DEVIATION_STEPS, 6)) / _DEVIATION_STEPS
        return cls(
            still_air_deviation=_within(deviation, DEVIATION_BOUNDS),
            still_air_factor=_within(_step_above(still_air_factor), STILL_AIR_BOUNDS),
            state_of_health=_within(_step_below(state_of_health), HEALTH_BOUNDS),
            charge_rate_factor=_within(_step_below(charge_rate_factor), CHARGE_RATE_BOUNDS),
        )

    def charging_at_most(self, charge_rate_factor: float | None) -> Self:
        """These values, with this charge rate if it is lower; None changes nothing."""
        if charge_rate_factor is None:
            return self
        factor = _within(_step_below(charge_rate_factor), CHARGE_RATE_BOUNDS)
        if factor >= self.charge_rate_factor:
            return self
        return self.model_copy(update={"charge_rate_factor": factor})

    def in_cold(self, temperature_c: float) -> Self:
        """These values in air of this temperature, degrees Celsius: in the cold it charges slowly.

        Drones learn their charge rate against what their model does in the cold, so it counts once.
        """
        return self.charging_at_most(self.charge_rate_factor / cold_charging_factor(temperature_c))

    @property
    def consumption_factor(self) -> float:
        """The state of charge that a flight in still air uses, divided by the model's.

        A worn battery holds less energy, so the same flight uses more of its charge.
        """
        return self.still_air_factor / self.state_of_health

    def beyond(self, consumption_factor: float) -> float:
        """A drone's reported consumption factor, which is against its model, against these values.

        What is left is wind, and what has not been learned yet.
        """
        return consumption_factor / self.consumption_factor


def _within(value: float, bounds: tuple[float, float]) -> float:
    return min(bounds[1], max(bounds[0], value))


def _step_above(value: float) -> float:
    # Rounded first: (1.05 - 0.05) * 20 is a little more than 20.
    return math.ceil(round((value - _NEAR) * _STEPS, 6)) / _STEPS


def _step_below(value: float) -> float:
    return math.floor(round((value + _NEAR) * _STEPS, 6)) / _STEPS


#: A drone that is as its model says.
AS_MODELLED: Final = LearnedValues()


@lru_cache(maxsize=1_000)
def model_as_learned(model: DroneModel, values: LearnedValues) -> DroneModel:
    """The model with one drone's own power, battery and charge curve; its reserve stays.

    Landings use the model's energy.
    """
    if values == AS_MODELLED:
        return model
    slower = 1 / values.charge_rate_factor
    # Not `model_copy`: the copy would keep the charge columns that the model has cached.
    return DroneModel.model_construct(
        **{name: getattr(model, name) for name in DroneModel.model_fields}
        | {
            "power_empty_w": min(model.power_empty_w * values.still_air_factor, _MOST_POWER_W),
            "battery_j": max(model.battery_j * values.state_of_health, _LEAST_BATTERY_J),
            "charge_curve": tuple(
                ChargePoint(min(point.time_s * slower, _MOST_TIME_S), point.soc)
                for point in model.charge_curve
            ),
        }
    )
