"""What the planner is asked for a request: the delivery, the way home, the way onward."""

from collections.abc import Iterable
from dataclasses import dataclass

from skyway.delivery.request import Package
from skyway.drone.model import DroneModel
from skyway.ids import PackageId, StationId
from skyway.planner.problem import DroneAtStart, PackageToDeliver, Problem
from skyway.units import ms_to_moment
from skyway_composition.planning.world import World

#: The package that stands for the empty drone on its way home (decisions.md, Booking).
_NOTHING = PackageId("home")


@dataclass(frozen=True, slots=True)
class Standing:
    """A drone on the ground, able to start."""

    model: DroneModel
    soc: float
    station_id: StationId


def delivery_problem(
    world: World,
    drone: Standing,
    *,
    pickup: StationId,
    packages: Iterable[Package],
    start_ms: int,
    latest_ms: int | None,
) -> Problem:
    """Fly to the pickup, load, deliver everything; the last delivery at `latest_ms` at most."""
    return Problem(
        network=world.skyway.network,
        start_at=ms_to_moment(start_ms),
        drone=_at_start(drone),
        source=pickup,
        packages=_to_deliver(packages),
        loading_s=world.skyway.settings.loading_s,
        dropoff_s=world.skyway.settings.dropoff_s,
        latest_delivery_s=None if latest_ms is None else (latest_ms - start_ms) / 1000,
    )


def onward_problem(
    world: World, drone: Standing, *, packages: Iterable[Package], start_ms: int
) -> Problem:
    """Deliver what is already on board, from where the drone stands.

    There is no deadline: packages that are late are still better delivered than stranded.
    """
    return Problem(
        network=world.skyway.network,
        start_at=ms_to_moment(start_ms),
        drone=_at_start(drone),
        source=drone.station_id,
        packages=_to_deliver(packages),
        dropoff_s=world.skyway.settings.dropoff_s,
    )


def home_problem(
    world: World, drone: Standing, *, home_station_id: StationId, start_ms: int
) -> Problem:
    """Fly home empty: a package of 0 kg, with nobody waiting for it."""
    nothing = PackageToDeliver(package_id=_NOTHING, mass_kg=0.0, destination=home_station_id)
    return Problem(
        network=world.skyway.network,
        start_at=ms_to_moment(start_ms),
        drone=_at_start(drone),
        source=drone.station_id,
        packages=(nothing,),
        finish="stay",
    )


def _at_start(drone: Standing) -> DroneAtStart:
    return DroneAtStart(model=drone.model, soc=drone.soc, station_id=drone.station_id)


def _to_deliver(packages: Iterable[Package]) -> tuple[PackageToDeliver, ...]:
    return tuple(
        PackageToDeliver(
            package_id=package.package_id,
            mass_kg=package.mass_kg,
            destination=package.destination.station_id,
        )
        for package in packages
    )
