"""What is told of all drones together."""

from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Any, Final

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.json_model import JsonModel
from skyway_provider_registry.fleets.states import DroneStateName, state_named

_NAMES: Final = (
    "is_in_maintenance",
    "has_connected",
    "is_online",
    "activity",
    "has_mission",
    "mission_state",
    "names_mission",
)

Seconds = Annotated[float | None, Field(description="wall seconds; null when nothing was heard")]


class FleetStatistics(JsonModel):
    """All drones now. Lag: of drones that are online, from a message's moment to our hearing it.

    `states` and `samples` count what drones have sent in their present sessions: from one answer to
    the next they grow by what was sent meanwhile.
    """

    at: FleetMoment
    drones: int
    by_state: dict[DroneStateName, int]
    states: int
    samples: int
    lag_mean_s: Seconds
    lag_max_s: Seconds


def totals(rows: Sequence[Any], *, at: datetime, rate: float) -> FleetStatistics:
    """The statistics of these groups of drones; Any: rows of a query."""
    by_state: Counter[DroneStateName] = Counter()
    for row in rows:
        by_state[state_named(**{name: getattr(row, name) for name in _NAMES})] += row.drones
    online = [row for row in rows if row.is_online and row.heard]
    heard = sum(row.heard for row in online)
    late_ms = sum(float(row.late_ms) for row in online)
    latest_ms = max((row.latest_ms for row in online), default=None)
    return FleetStatistics(
        at=at,
        drones=sum(by_state.values()),
        by_state=dict(sorted(by_state.items())),
        states=sum(int(row.states) for row in rows),
        samples=sum(int(row.samples) for row in rows),
        lag_mean_s=late_ms / heard / 1000 / rate if heard else None,
        lag_max_s=None if latest_ms is None else latest_ms / 1000 / rate,
    )
