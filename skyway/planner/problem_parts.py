"""The parts of a problem: the drone at its start, packages, reservations, closures."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, Discriminator, Field, Tag
from pydantic_core import PydanticCustomError

from skyway.drone.model import DroneModel
from skyway.ids import PackageId, StationId
from skyway.json_model import JsonModel
from skyway.network.network import MAX_PADS

#: Seconds, about three centuries: no moment or duration of a problem lies further away.
MAX_SECONDS = 1e10

#: Kilograms; far above any drone, so that a package too heavy to fly gets a proof, not a complaint.
MAX_PACKAGE_KG = 1e12


def not_text_or_truth(value: Any) -> Any:  # any JSON value
    """The value, unless it only passes for a number: text, true, false."""
    if isinstance(value, bool | str | bytes):
        raise PydanticCustomError("whole_number", "Input should be a whole number")
    return value


# Strict: neither true nor "1" is a number.
Seconds = Annotated[
    float,
    Field(
        ge=-MAX_SECONDS, le=MAX_SECONDS, strict=True, description="seconds since the plan's start"
    ),
]
Duration = Annotated[float, Field(ge=0, le=MAX_SECONDS, strict=True, description="seconds")]


class DroneAtStart(JsonModel):
    """The drone, its charge at time 0, and where it stands then (null: at the source)."""

    model: Annotated[DroneModel, Field(description="The type of drone.")]
    soc: Annotated[
        float, Field(le=1, strict=True, description="State of charge at time 0, up to 1.")
    ]
    station_id: StationId | None = None


class PackageToDeliver(JsonModel):
    """A package, its mass, and the station and window of its hand-over."""

    package_id: PackageId
    mass_kg: Annotated[
        float, Field(ge=0, le=MAX_PACKAGE_KG, strict=True, description="Mass in kilograms.")
    ]
    destination: StationId
    not_before_s: Annotated[
        Seconds | None, Field(description="The hand-over does not begin before.")
    ] = None
    latest_s: Annotated[Seconds | None, Field(description="The hand-over is over by then.")] = None


class PadReservation(JsonModel):
    """A pad that another drone holds in [start_s, end_s); without end it is out of order."""

    station_id: StationId
    pad: Annotated[
        int,
        Field(ge=0, lt=MAX_PADS, description="The number of the pad, from 0."),
        BeforeValidator(not_text_or_truth),
    ]
    start_s: Seconds
    end_s: Seconds | None = None


class StationClosure(JsonModel):
    """A station where no drone lands in [start_s, end_s); a missing end is open."""

    station_id: StationId
    start_s: Seconds
    end_s: Seconds | None = None

    @property
    def closes(self) -> StationId:
        """What is closed."""
        return self.station_id


class SegmentClosure(JsonModel):
    """A segment that no drone flies, in this direction, in [start_s, end_s)."""

    from_id: Annotated[StationId, Field(alias="from")]
    to_id: Annotated[StationId, Field(alias="to")]
    start_s: Seconds
    end_s: Seconds | None = None

    @property
    def closes(self) -> tuple[StationId, StationId]:
        """What is closed, by its ends."""
        return self.from_id, self.to_id


def _closure_kind(closure: Any) -> str:  # any JSON value; its model checks it
    if isinstance(closure, Mapping):
        return "station" if "station_id" in closure else "segment"
    return "station" if isinstance(closure, StationClosure) else "segment"


Closure = Annotated[
    Annotated[StationClosure, Tag("station")] | Annotated[SegmentClosure, Tag("segment")],
    Discriminator(_closure_kind),
]
