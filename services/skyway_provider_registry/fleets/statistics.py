"""Statistics of all drones: counts by state, and the lag of their messages."""

from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Any, Final

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.json_model import JsonModel
from skyway_provider_registry.fleets.drone_states import DroneStateName, state_named

_NAMES: Final = (
    "is_in_maintenance",
    "has_connected",
    "is_online",
    "activity",
    "has_mission",
    "mission_state",
    "names_mission",
)


class FleetStatistics(JsonModel):
    """All drones now. The lag is the time from sending the newest message to receiving it.

    The growth of `states` and `samples` between two answers is the number of messages in between.
    """

    at: Annotated[FleetMoment, Field(description="moment of the answer, fleet time")]
    drones: Annotated[int, Field(description="number of drones")]
    by_state: Annotated[
        dict[DroneStateName, int], Field(description="number of drones in each state")
    ]
    states: Annotated[
        int, Field(description="state messages that drones sent in their present sessions")
    ]
    samples: Annotated[
        int, Field(description="telemetry messages that drones sent in their present sessions")
    ]
    lag_mean_s: Annotated[
        float | None,
        Field(description="mean lag of online drones, wall seconds; null without messages"),
    ]
    lag_max_s: Annotated[
        float | None,
        Field(description="largest lag of online drones, wall seconds; null without messages"),
    ]


def totals(rows: Sequence[Any], *, at: datetime, rate: float) -> FleetStatistics:
    """The statistics of these groups of drones. Any: rows of a query."""
    by_state: Counter[DroneStateName] = Counter()
    for row in rows:
        by_state[state_named(**{name: getattr(row, name) for name in _NAMES})] += row.drones
    online = [row for row in rows if row.is_online and row.received]
    received = sum(row.received for row in online)
    late_ms = sum(float(row.late_ms) for row in online)
    latest_ms = max((row.latest_ms for row in online), default=None)
    return FleetStatistics(
        at=at,
        drones=sum(by_state.values()),
        by_state=dict(sorted(by_state.items())),
        states=sum(int(row.states) for row in rows),
        samples=sum(int(row.samples) for row in rows),
        lag_mean_s=late_ms / received / 1000 / rate if received else None,
        lag_max_s=None if latest_ms is None else latest_ms / 1000 / rate,
    )
