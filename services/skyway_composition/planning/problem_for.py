"""The planner's problem for a delivery, for packages on board, for a landing, for a standby.

Every problem includes the energy margin of its network.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import datetime
from functools import lru_cache
from typing import Final, Literal

import numpy as np

from skyway.contracts.candidate import Candidate
from skyway.contracts.margins import Margins, RiskMargin
from skyway.delivery.plan import Fly
from skyway.delivery.request import DeliveryRequest, Package
from skyway.drone.cargo import CargoNeeds
from skyway.drone.model import DroneModel
from skyway.ids import PackageId, StationId
from skyway.planner.energy_risk import LEAST_MARGIN, MODEL_DEVIATION, MOST_MARGIN, EnergyRisk
from skyway.planner.problem import DroneAtStart, PackageToDeliver, PadReservation, Problem
from skyway.scheduling.trip import BookedPad, Trip
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.planning.world import World

#: The package that stands for an empty drone on its way (docs/reference/booking.md).
_NOTHING = PackageId("home")

#: A smaller factor lies within the error of a drone's sensors. Then the drone judges its plans by
#: its model alone, and so do we.
_AS_PLANNED_FACTOR: Final = 1.02

#: The largest factor that drones report; a larger one would have another cause.
_LARGEST_FACTOR: Final = 4.0

#: Plans add this much to the measured value and round up to one of so many steps. Gusts change
#: the value, and an accepted plan should not be too small a minute later. Our own choice.
_HEADROOM, _STEPS = 0.02, 20


@dataclass(frozen=True, slots=True)
class Standing:
    """A drone on the ground, able to start; `model` is its planned model, without margin.

    Its own `energy_margin` counts if it is larger than the network's.
    """

    model: DroneModel
    soc: float
    station_id: StationId
    energy_margin: float = 0.0


@dataclass(frozen=True, slots=True)
class AimedPackage:
    """A package on board, and the station it goes to now: its destination, or another one."""

    package: Package
    aim_station_id: StationId


def delivery_problem(
    world: World,
    drone: Standing,
    *,
    request: DeliveryRequest,
    start_ms: int,
    latest_ms: int | None,
    held: Iterable[BookedPad] = (),
) -> Problem:
    """Fly to the pickup, load, and deliver everything, the last package by `latest_ms`.

    Loading and each hand-over keep the windows of the request.

    Pads in `held` will be booked for other drones in the same transaction as this trip.
    """
    return Problem(
        network=world.skyway.network,
        start_at=ms_to_moment(start_ms),
        drone=_at_start(with_margins(world, drone)),
        source=request.pickup.station_id,
        packages=tuple(to_load(each, start_ms=start_ms) for each in request.packages),
        loading_s=world.skyway.settings.loading_s,
        dropoff_s=world.skyway.settings.hand_over_s(request.packages),
        latest_delivery_s=None if latest_ms is None else (latest_ms - start_ms) / 1000,
        pickup_not_before_s=(
            None
            if request.latest_pickup_at is None
            else _seconds(request.earliest_pickup_at, start_ms)
        ),
        pickup_latest_s=_seconds(request.latest_pickup_at, start_ms),
        pad_reservations=_reserved(world, held, start_ms=start_ms),
        closures=world.conditions.problem_closures(start_ms),
    )


def onward_problem(
    world: World, drone: Standing, *, loads: Iterable[AimedPackage], start_ms: int
) -> Problem:
    """Hand over the packages on board, each at the station it goes to now.

    There is no deadline, because a late package is better than a stranded one. A package on its way
    to its destination keeps its window.
    """
    loads = tuple(loads)
    return Problem(
        network=world.skyway.network,
        start_at=ms_to_moment(start_ms),
        drone=_at_start(with_margins(world, drone)),
        source=drone.station_id,
        packages=tuple(
            _to_deliver(each.package, each.aim_station_id, start_ms=start_ms) for each in loads
        ),
        dropoff_s=world.skyway.settings.hand_over_s(each.package for each in loads),
        closures=world.conditions.problem_closures(start_ms),
        are_on_board=True,
    )


def landing_problem(
    world: World,
    drone: Standing,
    *,
    packages: Iterable[Package],
    station_id: StationId,
    start_ms: int,
) -> Problem:
    """Fly to a station with these packages on board and stay there, without handing over."""
    return _flight_to(
        world,
        with_margins(world, drone),
        packages=packages,
        station_id=station_id,
        start_ms=start_ms,
    )


def standby_problem(
    world: World,
    drone: Standing,
    *,
    station_id: StationId,
    start_ms: int,
    held: Iterable[BookedPad] = (),
) -> Problem:
    """Fly empty to where the drone stands by.

    `drone` is the drone at the end of a plan, with its margins included.
    """
    return _flight_to(
        world, drone, packages=(), station_id=station_id, start_ms=start_ms, held=held
    )


def with_margins(world: World, drone: Standing) -> Standing:
    """The drone with its own energy margin or the network's, whichever is larger."""
    margin = max(world.energy_margin(drone.model), drone.energy_margin)
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
    on_board = tuple(_only_carried(each, station_id) for each in packages)
    return Problem(
        network=world.skyway.network,
        start_at=ms_to_moment(start_ms),
        drone=_at_start(drone),
        source=drone.station_id,
        packages=on_board or (nothing,),
        finish="stay",
        are_on_board=True,
        pad_reservations=_reserved(world, held, start_ms=start_ms),
        closures=world.conditions.problem_closures(start_ms),
    )


def _reserved(
    world: World, held: Iterable[BookedPad], *, start_ms: int
) -> tuple[PadReservation, ...]:
    """Reservations with a gap before them too; the gap after them is part of `held`."""
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


def to_load(package: Package, *, start_ms: int) -> PackageToDeliver:
    """A package for its destination, with what it needs of the drone that is chosen for it."""
    needs = {name: getattr(package, name) for name in CargoNeeds.model_fields}
    to_deliver = _to_deliver(package, package.destination.station_id, start_ms=start_ms)
    return to_deliver.model_copy(update=needs) if package.needs_cargo_check else to_deliver


def _to_deliver(package: Package, station_id: StationId, *, start_ms: int) -> PackageToDeliver:
    carried = _only_carried(package, station_id)
    if station_id != package.destination.station_id:
        # Its window belongs to its destination: elsewhere it is handed over when it arrives.
        return carried
    limits = {
        "not_before_s": _seconds(package.not_before_at, start_ms),
        "latest_s": _seconds(package.latest_at, start_ms),
    }
    return carried.model_copy(update=limits)


def _only_carried(package: Package, station_id: StationId) -> PackageToDeliver:
    return PackageToDeliver(
        package_id=package.package_id,
        mass_kg=package.mass_kg,
        destination=station_id,
    )


def _seconds(moment: datetime | None, start_ms: int) -> float | None:
    """A moment as seconds of a problem that begins at this millisecond."""
    return None if moment is None else (moment_to_ms(moment) - start_ms) / 1000


def margins_of(
    world: World, candidate: Candidate, trip: Trip, *, energy_margin: float = 0.0
) -> Margins:
    """The margins of a drone's trip, and what they are made of.

    The drone's own `energy_margin` counts if that is larger than its network's.
    """
    world, model, start_ms = world.for_drone(candidate.learned), candidate.model, trip.start_ms
    margins, risk = world.skyway.settings.margins, world.risk
    found: dict[str, object] = {"energy_margin": max(world.energy_margin(model), energy_margin)}
    flights = [step for step in trip.plan.steps if isinstance(step, Fly)]
    known = world.conditions.weather
    if known is not None and (air := known.air_of(model, flights, start_ms=start_ms)) is not None:
        found |= {"late_share": air.late_share, "air": air.known}
    if risk is not None:
        in_wind = [_in_wind(world, model, risk, each, start_ms=start_ms) for each in flights]
        most = max(range(len(flights)), key=in_wind.__getitem__, default=None)
        largest = (0.0, None) if most is None else (in_wind[most], flights[most])
        found["risk"] = _risk_margin(risk, *largest)
    return margins.model_copy(update=found)


def _in_wind(
    world: World, model: DroneModel, risk: EnergyRisk, step: Fly, *, start_ms: int
) -> float:
    known = world.conditions.weather
    if known is None:
        return risk.in_climate(model)
    at_s = start_ms / 1000 + step.start_s
    return known.in_error(model, (step.from_id, step.to_id), at_s=at_s, risk=risk)


def _risk_margin(risk: EnergyRisk, in_wind: float, flight: Fly | None) -> RiskMargin:
    wind = None if in_wind == math.inf else round(in_wind / risk.deviations, 4)
    margin = float(risk.margins(np.array(in_wind)))
    limits: dict[float, Literal["LEAST", "MOST"]] = {LEAST_MARGIN: "LEAST", MOST_MARGIN: "MOST"}
    return RiskMargin(
        reserve_risk=risk.reserve_risk,
        deviations=round(risk.deviations, 3),
        wind_deviation=wind,
        use_deviation=risk.use_deviation,
        model_deviation=MODEL_DEVIATION,
        flight_margin=round(margin, 4),
        limited_by=limits.get(margin),
        from_id=None if flight is None else flight.from_id,
        to_id=None if flight is None else flight.to_id,
    )


@lru_cache(maxsize=1_000)
def with_margin(model: DroneModel, energy_margin: float) -> DroneModel:
    """The model as planning uses it: every flight needs `energy_margin` more energy, as a share.

    Only problems hold such a model. Code that compares a drone with its plan, or asks for another
    plan, needs the planned model; otherwise the margin is added twice.
    """
    power_w = model.power_empty_w * (1 + energy_margin)
    return model.model_copy(update={"power_empty_w": power_w})


def used_more(consumption_factor: float) -> float:
    """The share of energy that a drone uses above its model, to 0.01; 0 when hardly any."""
    if consumption_factor <= _AS_PLANNED_FACTOR:
        return 0.0
    return round(min(consumption_factor, _LARGEST_FACTOR) - 1, 2)


def planned_more(consumption_factor: float) -> float:
    """The share that new plans for the drone add: a little more than measured, in steps."""
    more = used_more(consumption_factor)
    return math.ceil((more + _HEADROOM) * _STEPS) / _STEPS if more > 0 else 0.0
