"""Days with weather: what is flown on them, and what a forecast is worth there."""

import math
from dataclasses import replace

import pytest
from skyway_drone_agent.simulated.disturbances import read_scenario
from skyway_lab.experiments.flown import SETTING
from skyway_lab.experiments.instances import SHORT_RANGE, chance, texas_problem
from skyway_lab.experiments.weather import WeatherTrial, run_weather_trial
from skyway_lab.experiments.weather_day import DAYS, KindOfDay, WeatherDay, fly_in_weather

from skyway.delivery.plan import Fly, Recharge
from skyway.planner.compose import compose

PROBLEM = texas_problem(replace(SETTING, model=SHORT_RANGE), seed=4)
CALM = KindOfDay(mean_mps=0.0, gust_mps=0.0)


def test_on_a_calm_day_everything_happens_as_planned() -> None:
    plan = compose(PROBLEM)

    flown = fly_in_weather(PROBLEM, plan, WeatherDay.of(CALM, chance(1)))

    assert any(isinstance(step, Recharge) for step in plan.steps)
    assert flown.delivered_s == pytest.approx(plan.delivery_time_s)
    lowest = min(step.soc_end for step in plan.steps if isinstance(step, Fly))
    assert min(flown.landing_socs) == pytest.approx(lowest)


def test_a_plan_in_an_exact_forecast_without_gusts_is_late_by_rounding_only() -> None:
    day = WeatherDay.of(KindOfDay(mean_mps=5.0, gust_mps=0.0), chance(1))
    air = day.kind.planned_weather(PROBLEM.network, PROBLEM.drone.model, day.wind_mps)

    plan = compose(PROBLEM.model_copy(update={"weather": air}))
    flown = fly_in_weather(PROBLEM, plan, day)

    assert plan.delivery_time_s is not None
    assert 0.0 <= plan.delivery_time_s - flown.delivered_s < 0.02 * plan.delivery_time_s
    assert min(flown.landing_socs) >= PROBLEM.drone.model.reserve_soc - 1e-6


def test_gusts_have_the_strength_of_their_day_and_last_for_their_span() -> None:
    kind = KindOfDay(mean_mps=0.0, gust_mps=3.0, gust_span_m=2_000.0, gust_span_s=400.0)

    def felt(*, length_m: float) -> list[float]:
        """The time of the second of two flights, where the first one took longer than usual."""
        still_s, times = length_m / 20.0, []
        for number in range(400):
            day = WeatherDay.of(kind, chance(number))
            first_s = day.flight_s(still_s, length_m=length_m, bearing=0.0, at_s=0.0)
            second_s = day.flight_s(still_s, length_m=length_m, bearing=0.0, at_s=first_s)
            if first_s > still_s:
                times.append(second_s / still_s)
        return times

    near, far = felt(length_m=200.0), felt(length_m=40_000.0)
    assert sum(near) / len(near) > sum(far) / len(far) + 0.05
    assert sum(far) / len(far) < 1.05


@pytest.mark.parametrize("name", DAYS)
def test_a_kind_of_day_has_the_values_of_the_scenario_with_its_name(name: str) -> None:
    kind, scenario = DAYS[name], read_scenario(name)

    assert kind == KindOfDay(
        mean_mps=scenario.wind.mean_mps,
        gust_mps=scenario.wind.gust_mps,
        gust_span_m=scenario.wind.gust_span_m,
        gust_span_s=scenario.wind.gust_span_s,
        temperature_c=scenario.battery.temperature_c,
        capacity=scenario.battery.capacity,
        power_noise=scenario.power_noise,
    )


def test_a_forecast_keeps_drones_above_their_reserve() -> None:
    def low_landings(knowledge: str) -> float:
        trial = WeatherTrial("stormy", knowledge, seed=1, deliveries=25)
        flown = run_weather_trial(trial)
        return sum(one.low_landings for one in flown) / sum(one.landings for one in flown)

    assert low_landings("exact forecast") < low_landings("still air") / 3
    assert not math.isnan(low_landings("wrong by 1 m/s"))
