"""Whether the battery lasts from one recharge to the next without using the reserve."""

from collections.abc import Iterable
from dataclasses import dataclass

from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PackageOnBoard,
    PickUpStep,
    RechargeStep,
    ReturnStep,
)
from skyway.drone.flight import flight_energy_j
from skyway.drone.model import DroneModel

#: Share of the battery by which a stretch may fall short: a thousand times the planner's own
#: tolerance, so that no plan it verified is refused for rounding.
_ENERGY_TOLERANCE = 1e-6

#: A drone that uses at most this factor of its model's energy is judged by the model: the
#: difference is within the error of its sensors, and plans may use all energy above the reserve.
_AS_PLANNED_FACTOR = 1.02


@dataclass(frozen=True, slots=True)
class Shortfall:
    """A stretch that cannot be flown: at `step` its need exceeds the energy above the reserve."""

    step: FlyStep
    need_j: float
    have_j: float


def shortfall_of(
    steps: Iterable[FlightStep],
    *,
    model: DroneModel,
    soc: float,
    packages: tuple[PackageOnBoard, ...],
    consumption_factor: float = 1.0,
    judged_from: int = 0,
) -> Shortfall | None:
    """The first stretch that the battery cannot fly, if each recharge reaches its charge.

    `need_j` counts the whole stretch, up to the next recharge or the end. `consumption_factor` is
    the measured energy of flights as a multiple of the drone model's. Flights before the step
    `judged_from` count, but a shortfall in them is not reported.
    """
    factor = consumption_factor if consumption_factor > _AS_PLANNED_FACTOR else 1.0
    load = {package.package_id: package.mass_kg for package in packages}
    have_j, need_j = _above_reserve_j(model, soc), 0.0
    failing: FlyStep | None = None
    for step in steps:
        match step:
            case PickUpStep():
                load |= {package.package_id: package.mass_kg for package in step.packages}
            case DeliverStep() | ReturnStep():
                load = {key: mass for key, mass in load.items() if key not in step.package_ids}
            case FlyStep():
                need_j += _flight_j(model, step, load_kg=sum(load.values()), factor=factor)
                is_short = need_j > have_j + _ENERGY_TOLERANCE * model.battery_j
                if failing is None and is_short and step.step_id >= judged_from:
                    failing = step
            case RechargeStep():
                if failing is not None:
                    break
                soc_left = model.reserve_soc + (have_j - need_j) / model.battery_j
                soc_after = max(soc_left, min(step.until_soc, model.top_soc))
                have_j, need_j = _above_reserve_j(model, soc_after), 0.0
    return None if failing is None else Shortfall(failing, need_j=need_j, have_j=have_j)


def stretch_of(steps: tuple[FlightStep, ...]) -> tuple[FlightStep, ...]:
    """The steps before the next recharge, or all."""
    count = next((n for n, step in enumerate(steps) if isinstance(step, RechargeStep)), len(steps))
    return steps[:count]


def _above_reserve_j(model: DroneModel, soc: float) -> float:
    return (soc - model.reserve_soc) * model.battery_j


def _flight_j(model: DroneModel, step: FlyStep, *, load_kg: float, factor: float) -> float:
    landing_j = model.stop_j if step.lands else 0.0
    return factor * flight_energy_j(model, length_m=step.length_m, load_kg=load_kg) + landing_j
