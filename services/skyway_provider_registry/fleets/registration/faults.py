"""What speaks against registering drones: each fault with its place in the caller's list."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from skyway.ids import DroneModelId, StationId
from skyway_provider_registry.fleets.drone import NewDrone


@dataclass(frozen=True, slots=True)
class Fault:
    """A field of one of the drones, counted from 0, and what is wrong with it."""

    index: int
    field: str
    detail: str


def faults_of(
    new_drones: Sequence[NewDrone],
    *,
    models: Collection[DroneModelId],
    unknown_stations: Collection[StationId],
) -> list[Fault]:
    """All faults, in the order of the drones."""
    return [
        Fault(index, field, detail)
        for index, drone in enumerate(new_drones)
        for field, detail in _of_one(drone, models=models, unknown_stations=unknown_stations)
    ] + list(_repeated_registrations(new_drones))


def _of_one(
    drone: NewDrone,
    *,
    models: Collection[DroneModelId],
    unknown_stations: Collection[StationId],
) -> Iterator[tuple[str, str]]:
    if drone.model_id not in models:
        yield "model_id", f"no drone model is called {drone.model_id!r}"
    if drone.home_station_id in unknown_stations:
        yield "home_station_id", f"no station is called {drone.home_station_id!r}"


def _repeated_registrations(new_drones: Sequence[NewDrone]) -> Iterator[Fault]:
    first: dict[str, int] = {}
    for index, drone in enumerate(new_drones):
        if drone.registration is None:
            continue
        known = first.setdefault(drone.registration, index)
        if known != index:
            detail = f"{drone.registration!r} is the registration of drone {known} in this list too"
            yield Fault(index, "registration", detail)
