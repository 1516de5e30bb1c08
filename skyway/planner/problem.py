"""What the planner is asked: a network, a drone, its packages, and what stands in the way.

This is the one form of a problem: the body of `POST /v1/compositions`, the input of
`skyway compose` and the argument of `compose`. docs/reference/planner-problem.md describes it;
`problem_document` reads one with a complaint about all that is wrong.
"""

from collections.abc import Iterator, Sized
from itertools import islice
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BeforeValidator,
    Field,
    PlainSerializer,
    PlainValidator,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import PydanticCustomError

from skyway.bounds import Moment
from skyway.delivery.request import MAX_PACKAGES
from skyway.errors import FieldFault, InvalidNetwork, InvalidProblem
from skyway.ids import StationId
from skyway.json_model import JsonModel
from skyway.network.geojson import read_network, write_network
from skyway.network.network import Network
from skyway.planner.agreement import disagreements
from skyway.planner.problem_parts import (
    MAX_HELD,
    MAX_SECONDS,
    Closure,
    DroneAtStart,
    Duration,
    PackageToDeliver,
    PadReservation,
    Seconds,
    SegmentClosure,
    StationClosure,
    TimedAct,
    window_faults,
)
from skyway.planner.reservations import PadReservations
from skyway.planner.weather import Weather

__all__ = [
    "MAX_FAULTS",
    "MAX_SECONDS",
    "DroneAtStart",
    "PackageToDeliver",
    "PadReservation",
    "Problem",
    "SegmentClosure",
    "StationClosure",
    "network_of",
]

#: Labels; whole numbers up to here are exact in any JSON reader.
MAX_LABELS = 10**15

#: The most faults reported for one problem: a hostile document must not cause megabytes of text.
MAX_FAULTS = 50


def _few_packages(value: Any) -> Any:  # any JSON value; counted before a million are read
    if isinstance(value, Sized) and len(value) > MAX_PACKAGES:
        raise PydanticCustomError(
            "too_many",
            "{count} packages exceed the limit of {limit}",
            {"count": len(value), "limit": MAX_PACKAGES},
        )
    return value


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

    network: Annotated[NetworkAsGeoJson, Field(description="The network, as GeoJSON.")]
    start_at: Annotated[
        Moment | None,
        Field(description="The fleet time of second 0; zones need it."),
    ] = None
    drone: Annotated[DroneAtStart, Field(description="The drone at its start.")]
    are_on_board: Annotated[
        bool,
        Field(
            description="Whether the packages are on board already, so that loading takes no time, "
            "and needs no open station and no window."
        ),
    ] = False
    source: Annotated[StationId, Field(description="The station where the packages are picked up.")]
    # At least one is checked below: pydantic would count only those that are themselves valid.
    packages: Annotated[
        tuple[PackageToDeliver, ...],
        Field(
            json_schema_extra={"minItems": 1, "maxItems": MAX_PACKAGES},
            description="What is delivered, 1 to 100 packages.",
        ),
        BeforeValidator(_few_packages),
    ]
    pad_reservations: Annotated[
        PadReservations, Field(description="Pads that other drones hold.")
    ] = ()
    # A long list reports only its first fault.
    closures: Annotated[
        tuple[Closure, ...],
        Field(max_length=MAX_HELD, description="Stations and segments that are closed."),
    ] = ()
    weather: Annotated[
        Weather | None, Field(description="How the air changes flights; null: it is still.")
    ] = None
    strategy: Annotated[
        Annotated[str, Field(max_length=64)] | None,
        Field(description="Which strategy composes; chosen by the planner if null."),
    ] = None
    recharge_policy: Annotated[
        Literal["partial", "full"],
        Field(description="Whether a recharge may end before the battery is full."),
    ] = "partial"
    finish: Annotated[
        Literal["recharge", "stay"],
        Field(description="Whether the drone is recharged after the last delivery, or stays."),
    ] = "recharge"
    loading_s: Duration = 0.0
    dropoff_s: Duration = 0.0
    latest_delivery_s: Duration | None = None
    pickup_not_before_s: Annotated[
        Seconds | None, Field(description="Loading does not begin before.")
    ] = None
    pickup_latest_s: Annotated[Seconds | None, Field(description="Loading is over by then.")] = None
    time_limit_s: Annotated[
        Annotated[float, Field(gt=0, le=MAX_SECONDS)] | None,
        Field(description="Seconds after which the best plan so far is answered."),
    ] = None
    label_limit: Annotated[
        Annotated[int, Field(gt=0, le=MAX_LABELS)] | None,
        Field(description="Labels after which the best plan so far is answered."),
    ] = None

    @property
    def start_station_id(self) -> StationId:
        """Where the drone stands at time 0."""
        return self.drone.station_id or self.source

    @property
    def loading(self) -> TimedAct:
        """Loading at the source; packages on board need no time for it, and have no window."""
        if self.are_on_board:
            return TimedAct(None, None, 0.0)
        return TimedAct(self.pickup_not_before_s, self.pickup_latest_s, self.loading_s)

    @property
    def has_windows(self) -> bool:
        """Whether loading or some hand-over has a window."""
        return (
            self.loading.not_before_s is not None
            or self.loading.latest_s is not None
            or any(
                one.not_before_s is not None or one.latest_s is not None for one in self.packages
            )
        )

    @property
    def may_pass(self) -> bool:
        """Whether the drone may pass a place where packages change hands.

        It may in a problem with windows, and where such a place has opening hours.
        """
        hours = self.network.opening_hours
        places = (self.source, *(one.destination for one in self.packages))
        return self.has_windows or (bool(hours) and any(place in hours for place in places))

    @model_validator(mode="after")
    def _fields_agree(self) -> Self:
        faults = tuple(islice(self._disagreements(), MAX_FAULTS))
        if faults:
            raise InvalidProblem(*faults[0], *faults[1:])
        return self

    def _disagreements(self) -> Iterator[FieldFault]:
        yield from disagreements(
            self.network,
            start_at=self.start_at,
            drone=self.drone,
            source=self.source,
            packages=self.packages,
            pad_reservations=self.pad_reservations,
            closures=self.closures,
        )
        if self.weather is not None and self.network.stations:
            yield from self.weather.faults
        yield from window_faults(
            self.packages,
            loading=self.loading,
            dropoff_s=self.dropoff_s,
        )
