from dataclasses import replace

import pytest
from skyway_lab.experiments.flown import SETTING
from skyway_lab.experiments.flown_plan import Climate, Day, fly_plan
from skyway_lab.experiments.instances import SHORT_RANGE, chance, texas_problem

from skyway.delivery.plan import Fly, Recharge
from skyway.ids import StationId
from skyway.planner import compose

PROBLEM = texas_problem(replace(SETTING, model=SHORT_RANGE), seed=4)


@pytest.fixture(scope="module")
def plan():
    plan = compose(PROBLEM)
    assert any(isinstance(step, Recharge) for step in plan.steps)
    return plan


def days(climate: Climate, number: int = 50) -> list[Day]:
    return [Day.of(climate, chance(day)) for day in range(number)]


def test_on_a_calm_day_everything_happens_as_planned(plan):
    (day,) = days(Climate(), 1)

    flown = fly_plan(PROBLEM, plan, day)

    lowest = min(step.soc_end for step in plan.steps if isinstance(step, Fly))
    assert flown.delivered_s == pytest.approx(plan.delivery_time_s)
    assert flown.lowest_soc == pytest.approx(lowest)


def test_noise_takes_some_flights_below_the_reserve_and_not_others(plan):
    lowest = [fly_plan(PROBLEM, plan, day).lowest_soc for day in days(Climate(power_noise=0.05))]

    assert min(lowest) < PROBLEM.drone.model.reserve_soc - 0.001
    assert max(lowest) > min(lowest)


def test_late_pads_only_make_deliveries_late(plan):
    flights = [fly_plan(PROBLEM, plan, day) for day in days(Climate(late_share=1.0))]

    lowest = min(step.soc_end for step in plan.steps if isinstance(step, Fly))
    assert all(flown.delivered_s > plan.delivery_time_s for flown in flights)
    assert all(flown.lowest_soc == pytest.approx(lowest) for flown in flights)


def test_head_wind_costs_more_than_tail_wind_saves():
    wind = [Day.of(Climate(wind_mps=5.0), chance(number)) for number in range(400)]
    one, other = (
        PROBLEM.network.stations[StationId(s)].position for s in ("san-marcos", "san-antonio")
    )

    there_and_back = sum(
        day.slowness(one, other, air_speed_mps=23.0) + day.slowness(other, one, air_speed_mps=23.0)
        for day in wind
    )

    assert there_and_back > 2 * len(wind)


def test_the_same_chance_makes_the_same_day(plan):
    climate = Climate(power_noise=0.05, wind_mps=4.0, late_share=0.3)
    one, other = (fly_plan(PROBLEM, plan, Day.of(climate, chance("a"))) for _ in range(2))

    assert one == other
