"""What the planner is asked: a network, a drone, its packages, and what stands in the way.

This is the one form of a problem: the body of `POST /v1/compositions`, the input of
`skyway compose` and the argument of `compose`. planner.md, section 3, describes it.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AwareDatetime,
    Discriminator,
    Field,
    PlainSerializer,
    PlainValidator,
    Tag,
    WithJsonSchema,
    model_validator,
)

from skyway.delivery.request import MAX_DESTINATIONS, MAX_PACKAGES
from skyway.drone.model import DroneModel
from skyway.errors import InvalidNetwork, InvalidProblem
from skyway.ids import PackageId, StationId
from skyway.json_model import JsonModel
from skyway.network.geojson import read_network, write_network
from skyway.network.network import Network
from skyway.units import CHARGE_TOLERANCE

#: Seconds, about three centuries: no moment or duration of a problem lies further away.
MAX_SECONDS = 1e10

Seconds = Annotated[
    float, Field(ge=-MAX_SECONDS, le=MAX_SECONDS, description="seconds since the plan's start")
]
Duration = Annotated[float, Field(ge=0, le=MAX_SECONDS, description="seconds")]


class DroneAtStart(JsonModel):
    """The drone, its charge at time 0, and where it stands then (null: at the source)."""

    model: DroneModel
    soc: Annotated[float, Field(le=1)]
    station_id: StationId | None = None


class PackageToDeliver(JsonModel):
    """A package, its mass, and the station where it is handed over."""

    package_id: PackageId
    mass_kg: Annotated[float, Field(ge=0, strict=True)]
    destination: StationId


class PadReservation(JsonModel):
    """A pad that another drone holds in [start_s, end_s); without end it is out of order."""

    station_id: StationId
    pad: Annotated[int, Field(ge=0)]
    start_s: Seconds
    end_s: Seconds | None = None


class StationClosure(JsonModel):
    """A station where nobody lands in [start_s, end_s); a missing end is open."""

    station_id: StationId
    start_s: Seconds
    end_s: Seconds | None = None


class SegmentClosure(JsonModel):
    """A segment that nobody flies, in this direction, in [start_s, end_s)."""

    from_id: Annotated[StationId, Field(alias="from")]
    to_id: Annotated[StationId, Field(alias="to")]
    start_s: Seconds
    end_s: Seconds | None = None


def _closure_kind(closure: Any) -> str:  # whatever stands in the JSON; its model checks it
    if isinstance(closure, Mapping):
        return "station" if "station_id" in closure else "segment"
    return "station" if isinstance(closure, StationClosure) else "segment"


Closure = Annotated[
    Annotated[StationClosure, Tag("station")] | Annotated[SegmentClosure, Tag("segment")],
    Discriminator(_closure_kind),
]


def _network_of(value: Any) -> Network:  # any JSON value; read_network checks it
    if isinstance(value, Network):
        return value
    try:
        return read_network(value)
    except InvalidNetwork as error:
        path = error.field if error.field == "network" else f"network.{error.field}"
        raise InvalidNetwork(path, error.detail) from error


NetworkAsGeoJson = Annotated[
    Network,
    PlainValidator(_network_of),
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
        one field is pydantic's ValidationError.
    """

    network: NetworkAsGeoJson
    start_at: AwareDatetime | None = None
    drone: DroneAtStart
    source: StationId
    # At least one is checked below: pydantic would count only those that are themselves valid.
    packages: Annotated[
        tuple[PackageToDeliver, ...],
        Field(max_length=MAX_PACKAGES, json_schema_extra={"minItems": 1}),
    ]
    pad_reservations: tuple[PadReservation, ...] = ()
    closures: tuple[Closure, ...] = ()
    strategy: str | None = None
    recharge_policy: Literal["partial", "full"] = "partial"
    finish: Literal["recharge", "stay"] = "recharge"
    loading_s: Duration = 0.0
    dropoff_s: Duration = 0.0
    latest_delivery_s: Duration | None = None
    time_limit_s: Annotated[float, Field(gt=0, le=MAX_SECONDS)] | None = None
    label_limit: Annotated[int, Field(gt=0)] | None = None

    @property
    def start_station_id(self) -> StationId:
        """Where the drone stands at time 0."""
        return self.drone.station_id or self.source

    @model_validator(mode="after")
    def _fields_agree(self) -> Self:
        self._check_drone()
        self._check_packages()
        self._check_reservations()
        self._check_closures()
        if self.start_at is None:
            for zone in self.network.zones:
                if zone.active_from is not None or zone.active_until is not None:
                    raise InvalidProblem(
                        "start_at", f"is required: zone {zone.zone_id!r} has dates"
                    )
        return self

    def _check_drone(self) -> None:
        self._check_station("source", self.source)
        if self.drone.station_id is not None:
            self._check_station("drone.station_id", self.drone.station_id)
        reserve = self.drone.model.reserve_soc
        if self.drone.soc < reserve - CHARGE_TOLERANCE:
            raise InvalidProblem("drone.soc", f"{self.drone.soc} is below reserve_soc {reserve}")

    def _check_packages(self) -> None:
        if not self.packages:
            raise InvalidProblem("packages", "0 packages, at least 1 is needed")
        seen: set[PackageId] = set()
        for number, package in enumerate(self.packages):
            self._check_station(f"packages.{number}.destination", package.destination)
            if package.package_id in seen:
                raise InvalidProblem(
                    f"packages.{number}.package_id",
                    f"a second package called {package.package_id!r}",
                )
            seen.add(package.package_id)
        destinations = {package.destination for package in self.packages}
        if len(destinations) > MAX_DESTINATIONS:
            raise InvalidProblem(
                "packages",
                f"{len(destinations)} distinct destinations exceed the limit of {MAX_DESTINATIONS}",
            )

    def _check_reservations(self) -> None:
        for number, reservation in enumerate(self.pad_reservations):
            field = f"pad_reservations.{number}"
            self._check_station(f"{field}.station_id", reservation.station_id)
            pads = self.network.stations[reservation.station_id].pads
            if reservation.pad >= pads:
                raise InvalidProblem(
                    f"{field}.pad",
                    f"{reservation.pad} is not a pad of station {reservation.station_id!r}, "
                    f"which has {pads}, numbered from 0",
                )
            _check_interval(field, reservation.start_s, reservation.end_s)

    def _check_closures(self) -> None:
        for number, closure in enumerate(self.closures):
            field = f"closures.{number}"
            if isinstance(closure, StationClosure):
                self._check_station(f"{field}.station_id", closure.station_id)
            else:
                self._check_station(f"{field}.from", closure.from_id)
                self._check_station(f"{field}.to", closure.to_id)
                leaving = self.network.segments_from(closure.from_id)
                if all(segment.to_id != closure.to_id for segment in leaving):
                    raise InvalidProblem(
                        field, f"no segment from {closure.from_id!r} to {closure.to_id!r}"
                    )
            _check_interval(field, closure.start_s, closure.end_s)

    def _check_station(self, field: str, station_id: StationId) -> None:
        if station_id not in self.network.stations:
            raise InvalidProblem(field, f"no station is called {station_id!r}")


def _check_interval(field: str, start_s: float, end_s: float | None) -> None:
    if end_s is not None and end_s <= start_s:
        raise InvalidProblem(f"{field}.end_s", f"{end_s} is not after start_s {start_s}")
