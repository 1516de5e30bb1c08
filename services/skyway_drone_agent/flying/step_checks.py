"""Whether the steps of a mission can be flown: they fit together, and the battery lasts."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PackageOnBoard,
    PickUpStep,
    RechargeStep,
    ReturnStep,
    end_of,
)
from skyway.drone.flight import flight_energy_j
from skyway.drone.model import DroneModel
from skyway.ids import PackageId
from skyway_drone_agent.journal.logbook import start_of
from skyway_drone_agent.vehicle import EnergyUse, LoadedFlights

#: Share of the battery by which a stretch may fall short: a thousand times the planner's own
#: tolerance, so that no plan it verified is refused for rounding.
_ENERGY_TOLERANCE = 1e-6

#: A drone that uses at most this factor of its model's energy is judged by the model: the
#: difference is within the error of its sensors, and plans may use all energy above the reserve.
_AS_PLANNED_FACTOR = 1.02


def fault_in(
    steps: Sequence[FlightStep], *, first_step: int, packages: tuple[PackageOnBoard, ...]
) -> str | None:
    """The first fault in these steps, given the packages on board; None without a fault."""
    if not steps or steps[0].step_id != first_step:
        return f"the steps do not begin with first_step {first_step}"
    for before, step in pairwise(steps):
        if step.step_id != before.step_id + 1:
            return f"step {before.step_id} is followed by step {step.step_id}"
        if start_of(step) != end_of(before):
            return (
                f"step {step.step_id} begins at {start_of(step)}, "
                f"step {before.step_id} ends at {end_of(before)}"
            )
        if _stays_in_the_air(before) and not isinstance(step, FlyStep):
            return f"step {step.step_id} needs a landing, step {before.step_id} flies over"
    if _stays_in_the_air(steps[-1]):
        return f"step {steps[-1].step_id} is the last and does not land"
    return _fault_in_windows(steps) or _fault_in_hand_overs(steps, packages)


def heaviest_load_kg(steps: Sequence[FlightStep], packages: tuple[PackageOnBoard, ...]) -> float:
    """The most that is on board at any time during these steps."""
    load = {package.package_id: package.mass_kg for package in packages}
    heaviest_kg = sum(load.values())
    for step in steps:
        if isinstance(step, PickUpStep):
            load |= {package.package_id: package.mass_kg for package in step.packages}
            heaviest_kg = max(heaviest_kg, sum(load.values()))
        elif isinstance(step, DeliverStep | ReturnStep):
            load = {key: mass for key, mass in load.items() if key not in step.package_ids}
    return heaviest_kg


def _stays_in_the_air(step: FlightStep) -> bool:
    return isinstance(step, FlyStep) and not step.lands


def _fault_in_windows(steps: Sequence[FlightStep]) -> str | None:
    for step in steps:
        if step.planned_end_at < step.planned_start_at:
            return f"step {step.step_id} ends before it starts"
        if isinstance(step, RechargeStep) and step.not_after_at < step.not_before_at:
            return f"the reservation of step {step.step_id} ends before it starts"
    return None


def _fault_in_hand_overs(
    steps: Sequence[FlightStep], packages: tuple[PackageOnBoard, ...]
) -> str | None:
    on_board: set[PackageId] = {package.package_id for package in packages}
    for step in steps:
        if isinstance(step, PickUpStep):
            taken = {package.package_id for package in step.packages}
            if taken & on_board:
                return f"step {step.step_id} takes on {sorted(taken & on_board)} a second time"
            on_board |= taken
        elif isinstance(step, DeliverStep | ReturnStep):
            missing = set(step.package_ids) - on_board
            if missing:
                return f"step {step.step_id} hands over {sorted(missing)}, not on board then"
            on_board -= set(step.package_ids)
    return None


@dataclass(frozen=True, slots=True)
class Shortfall:
    """A stretch that cannot be flown: at `step` its need exceeds the energy above the reserve."""

    step: FlyStep
    need_j: float
    have_j: float


def as_modelled(_flights: LoadedFlights) -> float:
    """The energy use of a drone that flies as its model says, in still air."""
    return 1.0


def shortfall_of(
    steps: Iterable[FlightStep],
    *,
    model: DroneModel,
    soc: float,
    packages: tuple[PackageOnBoard, ...],
    energy_use: EnergyUse = as_modelled,
    judged_from: int = 0,
) -> Shortfall | None:
    """The first stretch that the battery cannot fly, if each recharge reaches its charge.

    `need_j` counts the whole stretch, up to the next recharge or the end. The wind that the drone
    feels counts for its next flights. After the next recharge the weather of the plan counts: the
    wind may have changed by then, and the drone judges the flights again before it takes off.
    Flights before the step `judged_from` count, but a shortfall in them is not reported.
    """
    have_j, has_flown = _above_reserve_j(model, soc), False
    for stretch in _stretches(steps, packages):
        factor = energy_use(() if has_flown else stretch.flights)
        factor *= _in_planned_weather(stretch, model) if has_flown else 1.0
        factor = factor if factor > _AS_PLANNED_FACTOR else 1.0
        failing, need_j = None, 0.0
        for step, load_kg in stretch.flights:
            need_j += _flight_j(model, step, load_kg=load_kg, factor=factor)
            is_short = need_j > have_j + _ENERGY_TOLERANCE * model.battery_j
            if failing is None and is_short and step.step_id >= judged_from:
                failing = step
        if failing is not None:
            return Shortfall(failing, need_j=need_j, have_j=have_j)
        soc_left = model.reserve_soc + (have_j - need_j) / model.battery_j
        soc_after = max(soc_left, min(stretch.until_soc, model.top_soc))
        have_j = _above_reserve_j(model, soc_after)
        has_flown = has_flown or bool(stretch.flights)
    return None


@dataclass(slots=True)
class _Stretch:
    """The flights before a recharge, or before the end, and the charge of that recharge."""

    flights: list[tuple[FlyStep, float]] = field(default_factory=list)
    until_soc: float = 0.0


def _stretches(
    steps: Iterable[FlightStep], packages: tuple[PackageOnBoard, ...]
) -> Iterator[_Stretch]:
    load = {package.package_id: package.mass_kg for package in packages}
    stretch = _Stretch()
    for step in steps:
        match step:
            case PickUpStep():
                load |= {package.package_id: package.mass_kg for package in step.packages}
            case DeliverStep() | ReturnStep():
                load = {key: mass for key, mass in load.items() if key not in step.package_ids}
            case FlyStep():
                stretch.flights.append((step, sum(load.values())))
            case RechargeStep():
                stretch.until_soc = step.until_soc
                yield stretch
                stretch = _Stretch()
            case _:
                pass
    yield stretch


def _in_planned_weather(stretch: _Stretch, model: DroneModel) -> float:
    """By how much the weather of the plan multiplies the energy of these flights."""
    still_j = planned_j = 0.0
    for step, load_kg in stretch.flights:
        flight_j = flight_energy_j(model, length_m=step.length_m, load_kg=load_kg)
        still_j += flight_j
        planned_j += flight_j * step.time_factor * step.energy_factor
    return planned_j / still_j if still_j else 1.0


def stretch_of(steps: tuple[FlightStep, ...]) -> tuple[FlightStep, ...]:
    """The steps before the next recharge, or all."""
    count = next((n for n, step in enumerate(steps) if isinstance(step, RechargeStep)), len(steps))
    return steps[:count]


def _above_reserve_j(model: DroneModel, soc: float) -> float:
    return (soc - model.reserve_soc) * model.battery_j


def _flight_j(model: DroneModel, step: FlyStep, *, load_kg: float, factor: float) -> float:
    landing_j = model.stop_j if step.lands else 0.0
    return factor * flight_energy_j(model, length_m=step.length_m, load_kg=load_kg) + landing_j
