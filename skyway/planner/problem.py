"""What the planner is asked: a network, a drone, its packages, and what stands in the way.

This is the one form of a problem: the body of `POST /v1/compositions`, the input of
`skyway compose` and the argument of `compose`. planner.md, section 3, describes it;
`problem_document` reads one with a complaint about all that is wrong.
"""

from collections.abc import Mapping, Sized
from itertools import islice
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AwareDatetime,
    BeforeValidator,
    Discriminator,
    FailFast,
    Field,
    PlainSerializer,
    PlainValidator,
    Tag,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import PydanticCustomError

from skyway.delivery.request import MAX_PACKAGES
from skyway.drone.model import DroneModel
from skyway.errors import InvalidNetwork, InvalidProblem
from skyway.ids import PackageId, StationId
from skyway.json_model import JsonModel
from skyway.network.geojson import read_network, write_network
from skyway.network.network import MAX_PADS, Network
from skyway.planner.agreement import disagreements

#: Seconds, about three centuries: no moment or duration of a problem lies further away.
MAX_SECONDS = 1e10

#: Kilograms; far above any drone, so that a package too heavy to fly gets a proof, not a complaint.
MAX_PACKAGE_KG = 1e12

#: Labels; the largest power of ten that a float holds exactly, as JSON may have to.
MAX_LABELS = 10**15

#: Faults that one problem is told of: a hostile document must not turn into megabytes of them.
MAX_FAULTS = 50


def _not_text_or_truth(value: Any) -> Any:  # any JSON value; only these two pass for numbers
    if isinstance(value, bool | str | bytes):
        raise PydanticCustomError("whole_number", "Input should be a whole number")
    return value


def _written_moment(value: Any) -> Any:  # any JSON value; seconds since 1970 would pass
    is_written = isinstance(value, str) and value[4:5] == "-"
    if isinstance(value, str | int | float) and not is_written:
        raise PydanticCustomError("moment", "Input should be an RFC 3339 moment with a time zone")
    return value


def _few_packages(value: Any) -> Any:  # any JSON value; counted before a million are read
    if isinstance(value, Sized) and len(value) > MAX_PACKAGES:
        raise PydanticCustomError(
            "too_many",
            "{count} packages exceed the limit of {limit}",
            {"count": len(value), "limit": MAX_PACKAGES},
        )
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

    model: DroneModel
    soc: Annotated[float, Field(le=1, strict=True)]
    station_id: StationId | None = None


class PackageToDeliver(JsonModel):
    """A package, its mass, and the station where it is handed over."""

    package_id: PackageId
    mass_kg: Annotated[float, Field(ge=0, le=MAX_PACKAGE_KG, strict=True)]
    destination: StationId


class PadReservation(JsonModel):
    """A pad that another drone holds in [start_s, end_s); without end it is out of order."""

    station_id: StationId
    pad: Annotated[int, Field(ge=0, lt=MAX_PADS), BeforeValidator(_not_text_or_truth)]
    start_s: Seconds
    end_s: Seconds | None = None


class StationClosure(JsonModel):
    """A station where nobody lands in [start_s, end_s); a missing end is open."""

    station_id: StationId
    start_s: Seconds
    end_s: Seconds | None = None

    @property
    def closes(self) -> StationId:
        """What is closed."""
        return self.station_id


class SegmentClosure(JsonModel):
    """A segment that nobody flies, in this direction, in [start_s, end_s)."""

    from_id: Annotated[StationId, Field(alias="from")]
    to_id: Annotated[StationId, Field(alias="to")]
    start_s: Seconds
    end_s: Seconds | None = None

    @property
    def closes(self) -> tuple[StationId, StationId]:
        """What is closed, by its ends."""
        return self.from_id, self.to_id


def _closure_kind(closure: Any) -> str:  # whatever stands in the JSON; its model checks it
    if isinstance(closure, Mapping):
        return "station" if "station_id" in closure else "segment"
    return "station" if isinstance(closure, StationClosure) else "segment"


Closure = Annotated[
    Annotated[StationClosure, Tag("station")] | Annotated[SegmentClosure, Tag("segment")],
    Discriminator(_closure_kind),
]


def network_of(value: Any) -> Network:  # any JSON value; read_network checks it
    """The network in a problem's `network`; what is wrong is named by its path in the problem."""
    if isinstance(value, Network):
        return value
    try:
        return read_network(value)
    except InvalidNetwork as error:
        path = error.field if error.field == "network" else f"network.{error.field}"
        raise InvalidNetwork(path, error.detail) from error


NetworkAsGeoJson = Annotated[
    Network,
    PlainValidator(network_of),
    PlainSerializer(write_network, return_type=dict[str, Any]),  # GeoJSON: any JSON value
    WithJsonSchema({"type": "object", "description": "a skyway network as GeoJSON"}),
]


class Problem(JsonModel):
    """One drone, its packages and the network, with what others have reserved.

    `strategy` is a name of `skyway.planner.compose`; null takes the one it chooses.

    Raises
    ------
    InvalidProblem, InvalidNetwork
        The fields contradict one another; both name the field and the limit. What is wrong within
        one field is pydantic's ValidationError. `read_problem` raises InvalidProblem for all three.
    """

    network: NetworkAsGeoJson
    start_at: Annotated[AwareDatetime | None, BeforeValidator(_written_moment)] = None
    drone: DroneAtStart
    source: StationId
    # At least one is checked below: pydantic would count only those that are themselves valid.
    packages: Annotated[
        tuple[PackageToDeliver, ...],
        Field(json_schema_extra={"minItems": 1, "maxItems": MAX_PACKAGES}),
        BeforeValidator(_few_packages),
    ]
    # Of a list that has no limit only the first fault is told.
    pad_reservations: Annotated[tuple[PadReservation, ...], FailFast()] = ()
    closures: Annotated[tuple[Closure, ...], FailFast()] = ()
    strategy: Annotated[str, Field(max_length=64)] | None = None
    recharge_policy: Literal["partial", "full"] = "partial"
    finish: Literal["recharge", "stay"] = "recharge"
    loading_s: Duration = 0.0
    dropoff_s: Duration = 0.0
    latest_delivery_s: Duration | None = None
    time_limit_s: Annotated[float, Field(gt=0, le=MAX_SECONDS, strict=True)] | None = None
    label_limit: Annotated[
        Annotated[int, Field(gt=0, le=MAX_LABELS)] | None, BeforeValidator(_not_text_or_truth)
    ] = None

    @property
    def start_station_id(self) -> StationId:
        """Where the drone stands at time 0."""
        return self.drone.station_id or self.source

    @model_validator(mode="after")
    def _fields_agree(self) -> Self:
        faults = tuple(islice(disagreements(self), MAX_FAULTS))
        if faults:
            raise InvalidProblem(*faults[0], *faults[1:])
        return self
