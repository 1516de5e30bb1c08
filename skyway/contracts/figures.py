"""The counters and gauges of a service, which the gateway reads and shows to operators."""

from typing import Annotated, Final, Literal

from pydantic import Field

from skyway.contracts.message import WallMoment
from skyway.json_model import JsonModel, WireModel

#: Where the registry and composition show their counters and gauges.
FIGURES: Final = "/internal/figures"


class Figure(WireModel):
    """One number: a counter, a gauge, or the sum or count of a histogram."""

    name: Annotated[
        str, Field(description="The name of the metric.", examples=["skyway_queue_depth"])
    ]
    labels: Annotated[
        dict[str, str],
        Field(description="What it is about.", examples=[{"queue": "booking"}]),
    ]
    value: Annotated[float, Field(description="Its value now, in the unit of its name.")]


class LoggedError(WireModel):
    """A kind of warning or error that a process has logged since its start."""

    wall_at: Annotated[WallMoment, Field(description="When it was logged last, wall time.")]
    level: Annotated[str, Field(description="WARNING, ERROR or CRITICAL.", examples=["ERROR"])]
    event: Annotated[str, Field(description="What happened.", examples=["send failed"])]
    reason: Annotated[
        str | None, Field(description="The exception behind it; null without one.")
    ] = None
    times: Annotated[int, Field(ge=1, description="How often it was logged.")]
    trace_id: Annotated[
        str | None, Field(description="The trace that it belongs to, as the logs name it.")
    ] = None


class Figures(WireModel):
    """All numbers of one process, and the last errors in its log."""

    figures: tuple[Figure, ...]
    last_errors: tuple[LoggedError, ...] = ()


class ServiceHealth(JsonModel):
    """A service as the gateway finds it."""

    service: Annotated[str, Field(description="`gateway`, `registry` or `composition`.")]
    is_answering: Annotated[
        bool, Field(description="Whether it said within two seconds what it counts and measures.")
    ]
    figures: Annotated[
        tuple[Figure, ...],
        Field(description="What it counts and measures; of replicas, the one that answered."),
    ]
    last_errors: Annotated[
        tuple[LoggedError, ...],
        Field(
            description="Its warnings and errors since its start, one entry for each kind, the "
            "newest first, 20 at most."
        ),
    ] = ()


#: Whether a small world can be started: not here, not yet requested, requested.
SmallWorldState = Literal["UNAVAILABLE", "AVAILABLE", "REQUESTED"]

SmallWorldField = Annotated[
    SmallWorldState,
    Field(
        description="Whether an operator can have `skyway up` start simulated fleets on the "
        "bundled network: not here (UNAVAILABLE), yes (AVAILABLE), or it was requested before "
        "(REQUESTED)."
    ),
]


#: Processes whose processor and memory no figure counts.
NotCounted = Literal["BROKER", "DATABASE_SERVER", "OTHER_REPLICAS"]


class SystemHealth(JsonModel):
    """All services."""

    services: Annotated[tuple[ServiceHealth, ...], Field(description="The services.")]
    not_counted: Annotated[
        tuple[NotCounted, ...],
        Field(
            description="Processes whose processor and memory are in none of these figures: the "
            "broker; with PostgreSQL its server, and replicas that did not answer. Planners run in "
            "threads of composition, and SQLite in the services, so they are counted."
        ),
    ] = ()
    small_world: SmallWorldField


class RequestedSmallWorld(JsonModel):
    """The answer to an operator who asks for the small world."""

    small_world: SmallWorldField
