"""The input of the dispatcher: a fleet, the requests that have not started, and prices.

Moments are seconds from now. Trips that have started are not part of the problem: a drone that
flies is given by where, when and with what charge it is free again, and its pads are in
`pad_reservations`. docs/dispatch.md describes all fields.
"""

from collections import Counter
from collections.abc import Iterator
from itertools import islice
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from skyway.bounds import Moment
from skyway.delivery.request import MAX_PACKAGES, MAX_TRIP_DESTINATIONS
from skyway.drone.model import DroneModel
from skyway.errors import FieldFault, InvalidProblem
from skyway.ids import DroneId, StationId
from skyway.json_model import JsonModel
from skyway.planner.agreement import disagreements
from skyway.planner.problem import MAX_FAULTS, NetworkAsGeoJson
from skyway.planner.problem_document import read_with_network
from skyway.planner.problem_parts import (
    MAX_HELD,
    MAX_SECONDS,
    Closure,
    DroneAtStart,
    Duration,
    PackageToDeliver,
    Seconds,
    TimedAct,
    window_faults,
)
from skyway.planner.reservations import PadReservations
from skyway.units import CHARGE_TOLERANCE

#: The most drones, and the most requests, of one problem.
MAX_DRONES = 1_000
MAX_REQUESTS = 2_000

#: The most requests that may share a trip.
MAX_POOLED = 4

#: The most other stations where the packages of a request may be handed over.
MAX_PICKUPS = 100

#: The most destinations of one trip, as in the planner's problem.
MAX_DESTINATIONS = MAX_TRIP_DESTINATIONS

_Id = Annotated[str, Field(min_length=1, max_length=200)]
_Price = Annotated[float, Field(ge=0, le=1e9)]


class FleetDrone(JsonModel):
    """A drone, and the slot at which it can begin its first trip of the plan."""

    drone_id: DroneId
    provider_id: Annotated[str, Field(max_length=200, description="Whose drone it is.")] = ""
    model: Annotated[DroneModel, Field(description="The type of drone.")]
    station_id: Annotated[StationId, Field(description="Where the drone is free.")]
    free_s: Annotated[Duration, Field(description="When the drone is free.")] = 0.0
    soc: Annotated[float, Field(ge=0, le=1, description="State of charge at that moment.")]


class CurrentTrip(JsonModel):
    """The drone of a request in the current plan, and the start of its trip."""

    drone_id: DroneId
    start_s: Seconds


class FleetRequest(JsonModel):
    """A request that has not started.

    A delivery after `deadline_s` is possible, and has a price. `promised_s` is the moment that the
    customer was promised: the plan may deliver later than the promise by the problem's tolerance,
    or as late as the arrival order plus the tolerance. Windows of the pickup and of packages are
    never missed.
    """

    request_id: _Id
    source: Annotated[StationId, Field(description="Where the packages are picked up.")]
    packages: Annotated[tuple[PackageToDeliver, ...], Field(max_length=MAX_PACKAGES)]
    known_s: Annotated[
        float,
        Field(ge=-MAX_SECONDS, le=0, description="When the request came; 0 is now."),
    ] = 0.0
    pickup_not_before_s: Seconds | None = None
    pickup_latest_s: Seconds | None = None
    pickups: Annotated[
        tuple[StationId, ...],
        Field(
            max_length=MAX_PICKUPS,
            description="Other stations where the packages may be handed over, so that they share "
            "a trip from there.",
        ),
    ] = ()
    deadline_s: Seconds | None = None
    promised_s: Seconds | None = None
    pooling: Annotated[
        bool, Field(description="Whether the request may share a trip with other requests.")
    ] = False
    weight: Annotated[float, Field(gt=0, le=1e6)] = 1.0
    provider_ids: Annotated[
        tuple[str, ...] | None,
        Field(max_length=MAX_DRONES, description="The providers whose drones may fly it; any."),
    ] = None
    planned: CurrentTrip | None = None

    @property
    def has_windows(self) -> bool:
        """Whether loading or some hand-over has a window."""
        own = (self.pickup_not_before_s, self.pickup_latest_s)
        of_packages = (each for one in self.packages for each in (one.not_before_s, one.latest_s))
        return any(each is not None for each in (*own, *of_packages))

    @property
    def due_s(self) -> float | None:
        """The earlier one of deadline and promise; None if the request has neither."""
        given = [each for each in (self.deadline_s, self.promised_s) if each is not None]
        return min(given, default=None)

    @property
    def mass_kg(self) -> float:
        """The mass of all packages."""
        return sum(each.mass_kg for each in self.packages)


class Prices(JsonModel):
    """The prices in the objective, whose unit is one second of a request of weight 1."""

    delivery: Annotated[
        _Price,
        Field(description="For each second from a request's arrival to its last delivery."),
    ] = 1.0
    lateness: Annotated[
        _Price,
        Field(description="In addition, for each second after a deadline or a promise."),
    ] = 1.0
    energy_s_per_kwh: Annotated[_Price, Field(description="For each kWh of all flights.")] = 0.0
    move_s: Annotated[
        _Price,
        Field(description="For each request whose drone is not its drone in the current plan."),
    ] = 0.0
    unserved_s: Annotated[
        _Price,
        Field(description="For each request without a trip, in addition to the request's age."),
    ] = 1e6


class FleetProblem(JsonModel):
    """A fleet and its open requests.

    Raises
    ------
    InvalidProblem
        The fields contradict one another.
    """

    network: NetworkAsGeoJson
    start_at: Annotated[
        Moment | None, Field(description="The fleet time of second 0; zones and hours need it.")
    ] = None
    drones: Annotated[tuple[FleetDrone, ...], Field(max_length=MAX_DRONES)]
    requests: Annotated[tuple[FleetRequest, ...], Field(max_length=MAX_REQUESTS)]
    pad_reservations: PadReservations = ()
    closures: Annotated[tuple[Closure, ...], Field(max_length=MAX_HELD)] = ()
    loading_s: Duration = 0.0
    dropoff_s: Duration = 0.0
    hand_over_s: Annotated[Duration, Field(description="Between two trips of a drone.")] = 0.0
    pad_gap_s: Annotated[Duration, Field(description="Between two drones on one pad.")] = 0.0
    prices: Prices = Prices()
    promise_tolerance_s: Duration = 60.0
    most_pooled: Annotated[
        int,
        Field(ge=1, le=MAX_POOLED, description="The most requests that share a trip."),
    ] = 3
    fairness: Annotated[
        Literal["none", "requests"],
        Field(
            description="With requests, each provider flies at least as many requests as in the "
            "arrival order."
        ),
    ] = "none"
    baseline: Annotated[
        Literal["arrival order", "current plan"],
        Field(
            description="The plan with which the search begins. With the current plan, that of "
            "`requests[].planned`, every other plan keeps all promises within the tolerance, or "
            "delivers no later than the current plan."
        ),
    ] = "arrival order"
    label_limit: Annotated[
        int,
        Field(gt=0, le=10**9, description="The most labels of the search for one trip."),
    ] = 100_000

    @property
    def has_slow_loads(self) -> bool:
        """Whether no model flies faster with a load."""
        models = (each.model for each in self.drones)
        return all(each.speed_full_mps <= each.speed_empty_mps for each in models)

    @model_validator(mode="after")
    def _fields_agree(self) -> Self:
        faults = tuple(islice(self._disagreements(), MAX_FAULTS))
        if faults:
            raise InvalidProblem(*faults[0], *faults[1:])
        return self

    def _disagreements(self) -> Iterator[FieldFault]:
        if not self.drones:
            yield FieldFault("drones", "0 drones, at least 1 is due")
        yield from _repeated("drones", "drone_id", [each.drone_id for each in self.drones])
        yield from _repeated("requests", "request_id", [each.request_id for each in self.requests])
        named = Counter(one.package_id for each in self.requests for one in each.packages)
        for package_id, count in named.items():
            if count > 1:
                yield FieldFault("requests", f"{count} packages are called {package_id!r}")
        for number, drone in enumerate(self.drones):
            yield from self._of_drone(f"drones.{number}", drone)
        for number, request in enumerate(self.requests):
            yield from self._of_request(f"requests.{number}", request)
        if self.drones and self.drones[0].station_id in self.network.stations:
            yield from self._of_calendar()

    def _of_drone(self, field: str, drone: FleetDrone) -> Iterator[FieldFault]:
        if drone.station_id not in self.network.stations:
            yield FieldFault(f"{field}.station_id", f"no station {drone.station_id!r}")
        if drone.soc < drone.model.reserve_soc - CHARGE_TOLERANCE:
            yield FieldFault(
                f"{field}.soc", f"{drone.soc} lies below reserve_soc {drone.model.reserve_soc}"
            )

    def _of_request(self, field: str, request: FleetRequest) -> Iterator[FieldFault]:
        if not request.packages:
            yield FieldFault(f"{field}.packages", "0 packages, at least 1 is due")
        for name, station_id in (
            ("source", request.source),
            *((f"packages.{n}.destination", p.destination) for n, p in enumerate(request.packages)),
        ):
            if station_id not in self.network.stations:
                yield FieldFault(f"{field}.{name}", f"no station {station_id!r}")
        destinations = {each.destination for each in request.packages}
        if len(destinations) > MAX_DESTINATIONS:
            yield FieldFault(
                f"{field}.packages",
                f"{len(destinations)} destinations exceed the limit of {MAX_DESTINATIONS}",
            )
        for number, station_id in enumerate(request.pickups):
            name = f"{field}.pickups.{number}"
            if station_id not in self.network.stations:
                yield FieldFault(name, f"no station {station_id!r}")
            elif station_id in (request.source, *destinations, *request.pickups[:number]):
                detail = "is the source, a destination, or given twice"
                yield FieldFault(name, f"{station_id!r} {detail}")
        if request.pickups and not request.pooling:
            yield FieldFault(f"{field}.pickups", "other pickups need pooling")
        loading = TimedAct(request.pickup_not_before_s, request.pickup_latest_s, self.loading_s)
        for fault in window_faults(request.packages, loading=loading, dropoff_s=self.dropoff_s):
            yield FieldFault(f"{field}.{fault.field}", fault.detail)

    def _of_calendar(self) -> Iterator[FieldFault]:
        """Reservations, closures and the start, checked as the planner does."""
        drone = self.drones[0]
        yield from disagreements(
            self.network,
            start_at=self.start_at,
            drone=DroneAtStart(model=drone.model, soc=1.0, station_id=drone.station_id),
            source=drone.station_id,
            packages=(PackageToDeliver(package_id="-", mass_kg=0.0, destination=drone.station_id),),
            pad_reservations=self.pad_reservations,
            closures=self.closures,
        )


def _repeated(field: str, name: str, ids: list[Any]) -> Iterator[FieldFault]:
    for value, count in Counter(ids).items():
        if count > 1:
            yield FieldFault(field, f"{count} have the {name} {value!r}")


def read_fleet_problem(document: Any) -> FleetProblem:  # any JSON value, as json.loads gives it
    """The fleet problem that a JSON document describes; its `network` may also be a `Network`.

    Raises
    ------
    InvalidProblem
        Lists the faults of the document by field, at most `MAX_FAULTS`.
    """
    return read_with_network(FleetProblem, document)
