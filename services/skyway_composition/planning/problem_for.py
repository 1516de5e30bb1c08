"""What the planner is asked: the delivery, the way onward, a landing, the way home.

Every problem is made with the margins of its network (margins.py).
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

from skyway.delivery.request import Package
from skyway.drone.model import DroneModel
from skyway.ids import PackageId, StationId
from skyway.planner.problem import DroneAtStart, PackageToDeliver, PadReservation, Problem
from skyway.units import ms_to_moment
from skyway_composition.pads.booked_pad import BookedPad
from skyway_composition.planning.world import World

#: The package that stands for an empty drone on its way (docs/reference/booking.md).
_NOTHING = PackageId("home")


@dataclass(frozen=True, slots=True)
class Standing:
    """A drone on the ground, able to start; its model is the true one, without margin.

    It is planned for with its own `energy_margin`, if that is more than its network's.
    """

    model: DroneModel
    soc: float
    station_id: StationId
    energy_margin: float = 0.0


@dataclass(frozen=True, slots=True)
class PackageOnBoard:
    """A package on board and where it goes now: its destination, or somewhere else instead."""

    package: Package
    aim_station_id: StationId


def delivery_problem(
    world: World,
    drone: Standing,
    *,
    pickup: StationId,
    packages: Iterable[Package],
    start_ms: int,
    latest_ms: int | None,
    held: Iterable[BookedPad] = (),
) -> Problem:
    """Fly to the pickup, load, deliver everything; the last delivery at `latest_ms` at most.

    The pads that are `held` will be booked together with this trip, for other drones.
    """
    return Problem(
        network=world.skyway.network,
        start_at=ms_to_moment(start_ms),
        drone=_at_start(with_margins(world, drone)),
        source=pickup,
        packages=tuple(_to_deliver(each, each.destination.station_id) for each in packages),
        loading_s=world.skyway.settings.loading_s,
        dropoff_s=world.skyway.settings.dropoff_s,
        latest_delivery_s=None if latest_ms is None else (latest_ms - start_ms) / 1000,
        pad_reservations=_reserved(world, held, start_ms=start_ms),
        closures=world.conditions.problem_closures(start_ms),
    )


def onward_problem(
    world: World, drone: Standing, *, loads: Iterable[PackageOnBoard], start_ms: int
) -> Problem:
    """Hand over what is on board, each package where it goes now.

    There is no deadline: packages that are late are still better delivered than stranded.
    """
    return Problem(
        network=world.skyway.network,
        start_at=ms_to_moment(start_ms),
        drone=_at_start(with_margins(world, drone)),
        source=drone.station_id,
        packages=tuple(_to_deliver(each.package, each.aim_station_id) for each in loads),
        dropoff_s=world.skyway.settings.dropoff_s,
        closures=world.conditions.problem_closures(start_ms),
    )


def landing_problem(
    world: World,
    drone: Standing,
    *,
    packages: Iterable[Package],
    station_id: StationId,
    start_ms: int,
) -> Problem:
    """Fly to a station with these packages on board and stay there; nothing is handed over."""
    return _flight_to(
        world,
        with_margins(world, drone),
        packages=packages,
        station_id=station_id,
        start_ms=start_ms,
    )


def home_problem(
    world: World,
    drone: Standing,
    *,
    home_station_id: StationId,
    start_ms: int,
    held: Iterable[BookedPad] = (),
) -> Problem:
    """Fly home empty, as the drone that a plan leaves behind: it has its margins already."""
    return _flight_to(
        world, drone, packages=(), station_id=home_station_id, start_ms=start_ms, held=held
    )


def with_margins(world: World, drone: Standing) -> Standing:
    """The drone as problems have it: with the margin of its network, or more if it needs more."""
    margin = max(world.skyway.settings.energy_margin, drone.energy_margin)
    return replace(drone, model=with_margin(drone.model, margin))


def _flight_to(
    world: World,
    drone: Standing,
    *,
    packages: Iterable[Package],
    station_id: StationId,
    start_ms: int,
    held: Iterable[BookedPad] = (),
) -> Problem:
    nothing = PackageToDeliver(package_id=_NOTHING, mass_kg=0.0, destination=station_id)
    on_board = tuple(_to_deliver(each, station_id) for each in packages)
    return Problem(
        network=world.skyway.network,
        start_at=ms_to_moment(start_ms),
        drone=_at_start(drone),
        source=drone.station_id,
        packages=on_board or (nothing,),
        finish="stay",
        pad_reservations=_reserved(world, held, start_ms=start_ms),
        closures=world.conditions.problem_closures(start_ms),
    )


def _reserved(
    world: World, held: Iterable[BookedPad], *, start_ms: int
) -> tuple[PadReservation, ...]:
    """Pads that end with their gap; another drone must have left one before they begin, too."""
    gap_s = world.skyway.settings.pad_gap_s
    return tuple(
        PadReservation(
            station_id=each.station_id,
            pad=each.pad,
            start_s=(each.start_ms - start_ms) / 1000 - gap_s,
            end_s=(each.end_ms - start_ms) / 1000,
        )
        for each in held
    )


def _at_start(drone: Standing) -> DroneAtStart:
    return DroneAtStart(model=drone.model, soc=drone.soc, station_id=drone.station_id)


def _to_deliver(package: Package, station_id: StationId) -> PackageToDeliver:
    return PackageToDeliver(
        package_id=package.package_id, mass_kg=package.mass_kg, destination=station_id
    )


#: A drone that uses so little more than its model says is within what its sensors err: it judges
#: its plans by the model alone, and so do we.
_AS_PLANNED_FACTOR: Final = 1.02

#: Drones report no larger factor; beyond it something else is wrong.
_LARGEST_FACTOR: Final = 4.0

#: Plans have this much more than was measured, in so many steps: gusts come and go, and a plan that
#: a drone has taken should not be too little for it a minute later. Our own choice.
_HEADROOM, _STEPS = 0.02, 20


@lru_cache(maxsize=1_000)
def with_margin(model: DroneModel, energy_margin: float) -> DroneModel:
    """The model as it is planned with: every flight takes `energy_margin` more, as a share.

    Only problems hold such a model. Whoever compares a drone with its plan, or asks for another
    plan, needs the true one, else the margin is added twice.
    """
    power_w = model.power_empty_w * (1 + energy_margin)
    return model.model_copy(update={"power_empty_w": power_w})


def used_more(consumption_factor: float) -> float:
    """What a drone's flights take more than its model says, in hundredths, 0 if hardly any more."""
    if consumption_factor <= _AS_PLANNED_FACTOR:
        return 0.0
    return round(min(consumption_factor, _LARGEST_FACTOR) - 1, 2)


def planned_more(consumption_factor: float) -> float:
    """The same for plans that the drone is to fly: a little more, in steps."""
    more = used_more(consumption_factor)
    return math.ceil((more + _HEADROOM) * _STEPS) / _STEPS if more > 0 else 0.0
