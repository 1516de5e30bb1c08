"""What a drone's own flights show about it: energy use, battery and charging, against its model.

Each value is a mean that begins at the model's, which counts as some flights. One flight moves it
by little, and by at most so much, however far away it was. So a broken sensor or an odd day does
not matter, and a drone that lies about a flight gains hardly anything. Old flights are forgotten
slowly: motors and batteries age.

A drone estimates wind from its air speed, and reports its energy use without it. So wind is not
learned as a property of the drone.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, Final, Self

from pydantic import Field

from skyway.bounds import Moment
from skyway.contracts.drone_report import DroneHealth, DroneState
from skyway.drone.learned_values import (
    AS_MODELLED,
    CHARGE_RATE_BOUNDS,
    HEALTH_BOUNDS,
    STILL_AIR_BOUNDS,
    UNKNOWN_USE,
    LearnedValues,
)
from skyway.json_model import JsonModel

#: The model's value counts as so many flights, or recharges. The drone itself estimates its
#: battery over several flights. Our own choice, as are the next numbers.
_FLIGHTS_OF_MODEL: Final = 3
_RECHARGES_OF_MODEL: Final = 1

#: The mean is over about so many of the last flights or recharges.
_REMEMBERED: Final = 20

#: An observation further from the mean than this counts as so far away (Huber 1964).
_FARTHEST: Final = 0.25

#: A drone that is better than its model, or steadier than a drone that has not flown, is planned as
#: such after so many flights or recharges: then its plans carry less charge, and its offers cost
#: less.
_EVIDENCE: Final = 20


#: A drone that is planned with values beyond these needs a person who looks at its motors, or at
#: its contacts. The drone itself raises an alarm about a worn battery. Our own choice.
_MOST_USE: Final = 1.3
_SLOWEST_CHARGING: Final = 0.5

#: The need is over once both means are better than their limits by so much. So a drone near a limit
#: does not raise an alarm after every second flight.
_CLEARLY_BETTER: Final = 0.1


@dataclass(frozen=True, slots=True)
class Learned:
    """The values of a drone after so many flights and recharges, and whether it needs a person."""

    flights: int = 0
    recharges: int = 0
    still_air_factor: float = 1.0
    state_of_health: float = 1.0
    charge_rate_factor: float = 1.0
    is_maintenance_due: bool = False
    #: How many flights and recharges the health rests on: those with the battery that it has.
    health_observations: int = 0
    #: The mean square of the distance between a flight's energy use and `still_air_factor`.
    still_air_variance: float = UNKNOWN_USE**2

    def after_flight(self, health: DroneHealth) -> Self:
        """The values after a flight that the drone reports about; the same if it measured none."""
        if health.still_air_factor is None:
            return self
        flights = self.flights + 1
        weight = _FLIGHTS_OF_MODEL + flights
        factor = _mean(
            self.still_air_factor, health.still_air_factor, weight=weight, bounds=STILL_AIR_BOUNDS
        )
        # The mean is that of the flights before: while it is uncertain, the variance is larger.
        away = _away(self.still_air_factor, health.still_air_factor)
        variance = self.still_air_variance
        variance += (away**2 - variance) / min(weight, _REMEMBERED)
        after = replace(
            self._with_battery(health),
            flights=flights,
            still_air_factor=factor,
            still_air_variance=variance,
        )
        return after._with_need()

    def after_recharge(self, health: DroneHealth) -> Self:
        """The values after a recharge; the same if the drone measured none."""
        if health.charge_rate_factor is None:
            return self
        recharges = self.recharges + 1
        factor = _mean(
            self.charge_rate_factor,
            health.charge_rate_factor,
            weight=_RECHARGES_OF_MODEL + recharges,
            bounds=CHARGE_RATE_BOUNDS,
        )
        after = replace(self._with_battery(health), recharges=recharges, charge_rate_factor=factor)
        return after._with_need()

    @property
    def planned(self) -> LearnedValues:
        """The values that plans use."""
        flying, charging = self.still_air_factor, self.charge_rate_factor
        deviation = math.sqrt(self.still_air_variance)
        values = LearnedValues.in_steps(
            still_air_factor=flying if self.flights >= _EVIDENCE else max(1.0, flying),
            state_of_health=self.state_of_health,
            charge_rate_factor=charging if self.recharges >= _EVIDENCE else min(1.0, charging),
            still_air_deviation=(
                deviation if self.flights >= _EVIDENCE else max(UNKNOWN_USE, deviation)
            ),
        )
        # The same object for all such drones: selection compares it without looking into it.
        return AS_MODELLED if values == AS_MODELLED else values

    def _with_battery(self, health: DroneHealth) -> Self:
        observed = self.health_observations + 1
        mean = _mean(
            self.state_of_health,
            health.state_of_health,
            weight=_RECHARGES_OF_MODEL + observed,
            bounds=HEALTH_BOUNDS,
        )
        return replace(self, state_of_health=mean, health_observations=observed)

    def _with_need(self) -> Self:
        """The same values; a need for maintenance begins beyond a limit, and ends well within."""
        planned = self.planned
        if planned.still_air_factor >= _MOST_USE or planned.charge_rate_factor <= _SLOWEST_CHARGING:
            return replace(self, is_maintenance_due=True)
        is_better = (
            self.still_air_factor <= _MOST_USE - _CLEARLY_BETTER
            and self.charge_rate_factor >= _SLOWEST_CHARGING + _CLEARLY_BETTER
        )
        return replace(self, is_maintenance_due=False) if is_better else self


def learned_from(learned: Learned, *, before: str, state: DroneState) -> Learned:
    """The values after this state of a drone whose activity was `before`."""
    if state.health is None or state.activity == before:
        return learned
    if before == "FLYING" and state.activity != "DOWN":
        return learned.after_flight(state.health)
    return learned.after_recharge(state.health) if before == "RECHARGING" else learned


def why_maintenance(before: Learned, after: Learned) -> str | None:
    """Why a person should look at the drone; None if no need for it has begun."""
    if before.is_maintenance_due or not after.is_maintenance_due:
        return None
    if after.planned.still_air_factor >= _MOST_USE:
        return (
            f"its last flights used {after.still_air_factor:.2f} times the energy of its model in "
            "still air: look at its motors and propellers"
        )
    return (
        f"it charges at {after.charge_rate_factor:.2f} of its model's rate: look at its "
        "contacts and its battery"
    )


def _mean(mean: float, observed: float, *, weight: int, bounds: tuple[float, float]) -> float:
    """The mean with one more observation, which counts as one in `weight`."""
    moved = mean + _away(mean, observed) / min(weight, _REMEMBERED)
    return min(bounds[1], max(bounds[0], moved))


def _away(mean: float, observed: float) -> float:
    return min(_FARTHEST, max(-_FARTHEST, observed - mean))


class LearnedDrone(JsonModel):
    """What the flights of a drone have shown, and what plans use of it."""

    still_air_factor: Annotated[
        float,
        Field(
            description="energy that its flights use in still air, divided by the model's",
            examples=[1.12],
        ),
    ]
    state_of_health: Annotated[
        float,
        Field(
            description="energy that its full battery holds, divided by the model's", examples=[0.9]
        ),
    ]
    charge_rate_factor: Annotated[
        float,
        Field(
            description="how fast its state of charge rises on a pad, divided by the model's",
            examples=[0.86],
        ),
    ]
    flights: Annotated[int, Field(description="flights that this rests on", examples=[42])]
    recharges: Annotated[int, Field(description="recharges that this rests on", examples=[17])]
    since_at: Annotated[
        Moment,
        Field(
            description="moment of the first of them, or when its battery was installed; fleet time"
        ),
    ]
    planned: Annotated[
        LearnedValues,
        Field(
            description="what plans use: in steps of 0.05, rounded to the worse one; better than "
            "the model only after 20 flights or recharges; the deviation in steps of 0.02, below "
            "0.08 only after 20 flights"
        ),
    ]
