"""A plan flown on a day with disturbances: when it delivers, and how far the battery falls."""

from dataclasses import dataclass

from skyway.delivery.plan import Fly, Plan, Recharge, Wait
from skyway.drone.charging import recharge_time_s
from skyway.drone.flight import speed_mps
from skyway.drone.model import DroneModel
from skyway.drone.power import flight_power_w
from skyway.experiments.disturbances import Day
from skyway.planner.problem import Problem


@dataclass(frozen=True, slots=True)
class Flown:
    """The moment of the last delivery, and the lowest charge on the way."""

    delivered_s: float
    lowest_soc: float


def fly_plan(problem: Problem, plan: Plan, day: Day) -> Flown:
    """Fly the plan as it stands, without planning anew.

    A session begins at its planned time, or when drone and pad are ready, and lasts until the
    planned charge. An empty battery stays at 0: such a flight counts as below the reserve, and goes
    on so that it has a time. `problem` holds the true drone; the plan may have been made for a
    drone that uses more energy.
    """
    model = problem.drone.model
    now_s, soc, lowest_soc = 0.0, problem.drone.soc, problem.drone.soc
    for step in plan.steps:
        if isinstance(step, Fly):
            flight_s = _flight_s(problem, step, day)
            power_w = flight_power_w(model, step.load_kg) * day.power_factor()
            soc = max(0.0, soc - power_w * flight_s / model.battery_j)
            now_s, lowest_soc = now_s + flight_s, min(lowest_soc, soc)
        elif isinstance(step, Recharge):
            now_s = max(now_s, step.start_s) + day.pad_delay_s()
            now_s += _charging_s(model, soc, step.soc_end)
            soc = max(soc, step.soc_end)
        elif isinstance(step, Wait):
            now_s = max(now_s, step.end_s)
        else:
            now_s += step.end_s - step.start_s
    return Flown(now_s, lowest_soc)


def _flight_s(problem: Problem, step: Fly, day: Day) -> float:
    stations = problem.network.stations
    slowness = day.slowness(
        stations[step.from_id].position,
        stations[step.to_id].position,
        air_speed_mps=speed_mps(problem.drone.model, step.load_kg),
    )
    return (step.end_s - step.start_s) * slowness


def _charging_s(model: DroneModel, soc: float, until_soc: float) -> float:
    if soc >= until_soc:
        return 0.0
    return recharge_time_s(model, max(soc, model.charge_curve[0].soc), until_soc)
