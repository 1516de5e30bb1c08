"""How the planned steps of a mission will go, from its drone's last report: times and charge."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PickUpStep,
    RechargeStep,
    ReturnStep,
    WaitStep,
)
from skyway.drone.charging import model_on_pad, recharge_time_s, soc_after_recharge
from skyway.drone.flight import flight_energy_j, flight_time_s
from skyway.drone.model import DroneModel
from skyway.geo import Position, distance_m
from skyway.ids import PackageId
from skyway.units import moment_to_ms
from skyway_composition.missions.replanning.situation import Whereabouts


@dataclass(frozen=True, slots=True)
class Load:
    """The packages on board, and the mass of each package of the mission."""

    masses_kg: Mapping[PackageId, float]
    carried: frozenset[PackageId]

    @property
    def mass_kg(self) -> float:
        """The mass of all that is on board."""
        return sum(self.masses_kg.get(each, 0.0) for each in self.carried)

    def after(self, step: FlightStep) -> "Load":
        """What is on board once a step has ended."""
        match step:
            case PickUpStep():
                taken = frozenset(each.package_id for each in step.packages)
                return Load(self.masses_kg, self.carried | taken)
            case DeliverStep() | ReturnStep():
                return Load(self.masses_kg, self.carried.difference(step.package_ids))
            case _:
                return self


@dataclass(frozen=True, slots=True)
class PredictedStep:
    """When a step will begin and end, and the drone's charge and load at its end.

    A charge below 0 means that a flight is not possible. A RECHARGE `is_lost` when the drone comes
    after the end of its session, and `is_short` when it charges less than planned.
    """

    step: FlightStep
    start_ms: int
    end_ms: int
    soc_end: float
    load: Load
    is_lost: bool = False
    is_short: bool = False


def predict(
    steps: Sequence[FlightStep],
    where: Whereabouts,
    *,
    model: DroneModel,
    load: Load,
    now_ms: int,
    later: DroneModel | None = None,
) -> Iterator[PredictedStep]:
    """The prediction of each step that has not ended, in order.

    `model` has the margin that flights are planned with. `later` is the model for flights after the
    next recharge that follows a flight, if it differs. `steps` begin with `where.next_step`.
    """
    at_ms, soc, is_airborne, has_flown = where.at_ms, where.soc, False, False
    for step in steps:
        if isinstance(step, RechargeStep) and has_flown:
            model = later or model
        has_flown = has_flown or isinstance(step, FlyStep)
        if step.step_id == where.next_step and where.is_under_way:
            predicted = _of_step_under_way(step, where, model=model, load=load, now_ms=now_ms)
        else:
            # A standing drone starts no step before its planned time or before now.
            start_ms = at_ms if is_airborne else max(at_ms, _not_before_ms(step), now_ms)
            predicted = _of_step(step, start_ms, soc=soc, model=model, load=load)
        yield predicted
        at_ms, soc, load = predicted.end_ms, predicted.soc_end, predicted.load
        is_airborne = isinstance(step, FlyStep) and not step.lands


def _not_before_ms(step: FlightStep) -> int:
    moment = step.not_before_at if isinstance(step, RechargeStep) else step.planned_start_at
    return moment_to_ms(moment)


def _of_step_under_way(
    step: FlightStep, where: Whereabouts, *, model: DroneModel, load: Load, now_ms: int
) -> PredictedStep:
    """The step under way, from the drone's last report on; it does not end before now."""
    match step:
        case FlyStep():
            left = _share_left(step, where.position)
            end_ms, soc = _flown(
                step, left * step.length_m, where.at_ms, soc=where.soc, model=model, load=load
            )
        case RechargeStep():
            return _charged(step, where.at_ms, soc=where.soc, model=model, load=load)
        case WaitStep():
            end_ms, soc = moment_to_ms(step.until_at), where.soc
        case _:
            begun_ms = max(where.free_ms, moment_to_ms(step.planned_start_at))
            end_ms, soc = begun_ms + _planned_ms(step), where.soc
    return PredictedStep(step, where.at_ms, max(end_ms, now_ms), soc, load.after(step))


def _of_step(
    step: FlightStep, start_ms: int, *, soc: float, model: DroneModel, load: Load
) -> PredictedStep:
    match step:
        case FlyStep():
            end_ms, soc = _flown(step, step.length_m, start_ms, soc=soc, model=model, load=load)
        case RechargeStep():
            return _charged(step, start_ms, soc=soc, model=model, load=load)
        case WaitStep():
            end_ms = max(start_ms, moment_to_ms(step.until_at))
        case _:
            end_ms = start_ms + _planned_ms(step)
    return PredictedStep(step, start_ms, end_ms, soc, load.after(step))


def _flown(
    step: FlyStep, length_m: float, start_ms: int, *, soc: float, model: DroneModel, load: Load
) -> tuple[int, float]:
    """When a flight of this length ends in its planned weather, and with which charge."""
    in_air_m = length_m * step.time_factor
    duration_s = flight_time_s(model, length_m=in_air_m, load_kg=load.mass_kg)
    energy_j = flight_energy_j(model, length_m=in_air_m, load_kg=load.mass_kg)
    energy_j *= step.energy_factor
    if step.lands:
        duration_s, energy_j = duration_s + model.stop_s, energy_j + model.stop_j
    return start_ms + round(duration_s * 1000), soc - energy_j / model.battery_j


def _charged(
    step: RechargeStep, start_ms: int, *, soc: float, model: DroneModel, load: Load
) -> PredictedStep:
    not_after_ms = moment_to_ms(step.not_after_at)
    if start_ms >= not_after_ms:
        return PredictedStep(step, start_ms, start_ms, soc, load, is_lost=True, is_short=True)
    least_soc = model.charge_curve[0].soc
    until_soc, begun_soc = min(step.until_soc, model.top_soc), max(soc, least_soc)
    if begun_soc >= until_soc:
        return PredictedStep(step, start_ms, start_ms, soc, load)
    charging = model_on_pad(model, step.power_w)
    full_ms = start_ms + round(recharge_time_s(charging, begun_soc, until_soc) * 1000)
    if full_ms <= not_after_ms:
        return PredictedStep(step, start_ms, full_ms, until_soc, load)
    short_soc = soc_after_recharge(charging, begun_soc, (not_after_ms - start_ms) / 1000)
    return PredictedStep(step, start_ms, not_after_ms, short_soc, load, is_short=True)


def _share_left(step: FlyStep, position: Position | None) -> float:
    """The share of a segment that lies ahead; 1 without a position."""
    whole_m = distance_m(step.from_position, step.to_position)
    if position is None or whole_m <= 0:
        return 1.0
    return min(1.0, distance_m(position, step.to_position) / whole_m)


def _planned_ms(step: FlightStep) -> int:
    return moment_to_ms(step.planned_end_at) - moment_to_ms(step.planned_start_at)
