"""What a drone has flown and used between two states, and when its maintenance is due.

The registry counts by its own clock: a drone flies from the arrival of a state that says so until
the arrival of the next state. So a drone cannot have flown for longer than time has passed, nor
for longer than a full battery lasts. Only the drop of its charge is the drone's own word; a drone
that hides its flights or its use of charge comes to maintenance later.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from skyway.bounds import Moment
from skyway.contracts.drone_report import DroneState
from skyway.contracts.drones import DroneAlarm
from skyway.ids import DroneId, DroneModelId, ProviderId
from skyway.json_model import JsonModel
from skyway_provider_registry.presence.jump import LastSeen

_HOUR_S: Final = 3_600.0


@dataclass(frozen=True, slots=True)
class Wear:
    """Seconds in the air, and charge used: 1 is a full battery, which is one cycle."""

    flown_s: float = 0.0
    used_soc: float = 0.0


def wear_between(before: LastSeen, after: DroneState, *, received_at: datetime) -> Wear:
    """What the drone has flown and used since its last state.

    After a change of battery no charge counts: the two states are of different batteries.
    """
    longest_s = before.model.battery_j / before.model.power_empty_w
    flown_s = min(before.passed_s(received_at), longest_s) if before.activity == "FLYING" else 0.0
    used_soc = 0.0 if before.has_other_battery else max(0.0, before.soc - after.soc)
    return Wear(flown_s, used_soc)


class MaintenanceRule(JsonModel):
    """After how much flying a drone is due for maintenance; the limit reached first counts."""

    every_flight_hours: Annotated[
        float | None,
        Field(gt=0, le=100_000, description="hours in the air; null: no limit", examples=[100]),
    ] = None
    every_cycles: Annotated[
        float | None,
        Field(
            gt=0,
            le=100_000,
            description="full charges that the drone uses; null: no limit",
            examples=[200],
        ),
    ] = None

    @model_validator(mode="after")
    def _has_a_limit(self) -> Self:
        if self.every_flight_hours is None and self.every_cycles is None:
            raise ValueError("a rule needs every_flight_hours or every_cycles")
        return self

    @property
    def every_flight_s(self) -> float | None:
        """The limit of `every_flight_hours` in seconds."""
        return None if self.every_flight_hours is None else self.every_flight_hours * _HOUR_S

    def why_due(self, wear: Wear) -> str | None:
        """Why this wear since the last maintenance makes a drone due; None if it does not."""
        return "; ".join(self._reasons(wear)) or None

    def _reasons(self, wear: Wear) -> Iterator[str]:
        if self.every_flight_s is not None and wear.flown_s >= self.every_flight_s:
            hours = wear.flown_s / _HOUR_S
            yield f"it has flown {hours:.1f} h, and is due every {self.every_flight_hours:g} h"
        if self.every_cycles is not None and wear.used_soc >= self.every_cycles:
            yield (
                f"it has used {wear.used_soc:.1f} full charges, and is due every "
                f"{self.every_cycles:g}"
            )


class ModelMaintenance(MaintenanceRule):
    """The rule for the provider's drones of one model."""

    model_id: Annotated[DroneModelId, Field(description="id of the drone model")]


class DroneMaintenance(JsonModel):
    """What a drone has flown since its last maintenance, as far as the registry has seen."""

    flight_hours: Annotated[float, Field(description="hours in the air since then", examples=[41])]
    cycles: Annotated[
        float, Field(description="full charges that it has used since then", examples=[73])
    ]
    maintained_at: Annotated[
        Moment | None,
        Field(description="when its last maintenance was recorded, fleet time; null: never"),
    ]
    due_since_at: Annotated[
        Moment | None,
        Field(
            description="since when it is due by its provider's rule, fleet time; null: it is not. "
            "A drone that is due is not chosen for new deliveries"
        ),
    ]

    @classmethod
    def of(
        cls, wear: Wear, *, maintained_at: datetime | None, due_since_at: datetime | None
    ) -> "DroneMaintenance":
        """The counters as they are shown."""
        return cls(
            flight_hours=round(wear.flown_s / _HOUR_S, 2),
            cycles=round(wear.used_soc, 2),
            maintained_at=maintained_at,
            due_since_at=due_since_at,
        )


#: The counters of a new drone.
NEVER_FLOWN: Final = DroneMaintenance.of(Wear(), maintained_at=None, due_since_at=None)


def maintenance_alarm(
    provider_id: ProviderId, drone_id: DroneId, reason: str, *, at: datetime, is_over: bool = False
) -> DroneAlarm:
    """The alarm that a drone is due for maintenance, or that it is so no more."""
    return DroneAlarm(
        provider_id=provider_id,
        drone_id=drone_id,
        level="WARNING",
        code="MAINTENANCE_DUE",
        detail=reason,
        at=at,
        is_over=is_over,
    )
