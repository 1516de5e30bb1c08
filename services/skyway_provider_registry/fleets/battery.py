"""A battery as its provider registers it, and as the registry knows it."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Final

from pydantic import Field

from skyway.bounds import Moment
from skyway.drone.learned_values import HEALTH_BOUNDS
from skyway.drone.model import DroneModel
from skyway.errors import InvalidInput
from skyway.ids import BatteryId, DroneId, DroneModelId, ProviderId
from skyway.json_model import JsonModel

#: The most past installations that are kept of a battery.
MOST_INSTALLATIONS: Final = 100

Serial = Annotated[
    str,
    Field(
        min_length=1,
        max_length=64,
        pattern=r"^[\x21-\x7e]+( [\x21-\x7e]+)*$",
        description="serial number on the battery, unique within its provider",
        examples=["TB60-0042"],
    ),
]


class NewBattery(JsonModel):
    """A battery to register; it is in no drone."""

    serial: Serial
    model_id: Annotated[DroneModelId, Field(description="id of the model of drones that it fits")]
    capacity_j: Annotated[
        float | None,
        Field(
            ge=1,
            le=1e12,
            description="usable energy of the full battery in joules; null: that of the model's "
            "battery",
        ),
    ] = None

    def first_health(self, model: DroneModel) -> float:
        """The health with which learning begins: its capacity divided by the model's, at most 1.

        Raises
        ------
        InvalidInput
            The capacity is below the least health that plans use.
        """
        if self.capacity_j is None:
            return HEALTH_BOUNDS[1]
        least_j = HEALTH_BOUNDS[0] * model.battery_j
        if self.capacity_j < least_j:
            raise InvalidInput(
                "capacity_j",
                f"{self.capacity_j:g} J is below the limit of {least_j:g} J, {HEALTH_BOUNDS[0]:g} "
                f"of the battery of drone model {model.model_id}",
            )
        return min(HEALTH_BOUNDS[1], self.capacity_j / model.battery_j)


@dataclass(frozen=True, slots=True)
class NewBatteryRow:
    """A battery that is not stored yet."""

    battery_id: BatteryId
    provider_id: ProviderId
    requested: NewBattery
    capacity_j: float
    state_of_health: float
    created_at: datetime


class BatteryChange(JsonModel):
    """The battery that a drone has from now on."""

    battery_id: Annotated[BatteryId, Field(description="id of a battery that is in no other drone")]


class PastInstallation(JsonModel):
    """A drone that a battery was in, from when to when, and how much charge it gave there."""

    drone_id: Annotated[DroneId, Field(description="the drone that it was in")]
    installed_at: Annotated[Moment, Field(description="when it was installed, fleet time")]
    removed_at: Annotated[Moment, Field(description="when it was removed, fleet time")]
    cycles: Annotated[float, Field(description="full charges that it gave there", examples=[12.5])]


class Battery(JsonModel):
    """A battery of a provider; its health is learned from the flights with it."""

    battery_id: Annotated[BatteryId, Field(description="id of the battery")]
    provider_id: Annotated[ProviderId, Field(description="id of its provider")]
    serial: Serial
    model_id: Annotated[DroneModelId, Field(description="id of the model of drones that it fits")]
    capacity_j: Annotated[
        float, Field(description="usable energy of the full battery in joules, when it was new")
    ]
    drone_id: Annotated[DroneId | None, Field(description="the drone that it is in; null: none")]
    installed_at: Annotated[
        Moment | None, Field(description="since when it is in this drone, fleet time")
    ]
    cycles: Annotated[
        float,
        Field(
            description="full charges that it has given in all drones, as far as the registry has "
            "seen",
            examples=[57.3],
        ),
    ]
    state_of_health: Annotated[
        float,
        Field(
            description="energy that it holds when full, divided by the model's", examples=[0.93]
        ),
    ]
    health_observations: Annotated[
        int, Field(description="flights and recharges that its health rests on", examples=[40])
    ]


class RegisteredBatteries(JsonModel):
    """The answer to the registration of a list of batteries."""

    items: Annotated[
        tuple[Battery, ...], Field(description="the new batteries, in the order of the list")
    ]


class BatteryWithHistory(Battery):
    """A battery, and the drones that it was in before: the last 100 installations."""

    past_installations: Annotated[
        tuple[PastInstallation, ...], Field(description="earlier installations, the newest first")
    ]
