"""What a service counts and measures, as the gateway asks for it and shows it to operators."""

from typing import Annotated, Final

from pydantic import Field

from skyway.json_model import JsonModel, WireModel

#: Where registry and composition say what they count and measure.
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


class Figures(WireModel):
    """All numbers of one process."""

    figures: tuple[Figure, ...]


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


class SystemHealth(JsonModel):
    """All services."""

    services: Annotated[tuple[ServiceHealth, ...], Field(description="The services.")]
