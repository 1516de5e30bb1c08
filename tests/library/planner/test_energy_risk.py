"""Margins that follow from a risk: a smaller risk needs a larger margin, within limits."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skyway.delivery.plan import Fly
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.network import Network, Segment, Station
from skyway.planner import compose
from skyway.planner.energy_risk import (
    CLIMATE_MPS,
    LEAST_MARGIN,
    MODEL_DEVIATION,
    MOST_MARGIN,
    EnergyRisk,
)
from skyway.planner.forecast import FADING, FADING_S, Forecast, weather_at_risk
from skyway.planner.verify import verify
from skyway.planner.weather import Weather
from skyway.planner.wind import SegmentWind
from tests.library.planner.conftest import MODEL, forecast

EAST, WEST, NORTH = range(3)

risks = st.floats(1e-6, 0.2)
deviations = st.floats(0.02, 0.26)


def network() -> Network:
    """Segments from a to the east, back to the west, and to the north."""
    places = {"a": (0.0, 0.0), "b": (0.1, 0.0), "c": (0.0, 0.1)}
    ends = [("a", "b"), ("b", "a"), ("a", "c")]
    return Network(
        {StationId(name): Station(StationId(name), Position(*at)) for name, at in places.items()},
        [Segment(StationId(one), StationId(other), 1e4) for one, other in ends],
    )


def weather(given: Forecast, risk: EnergyRisk, model: DroneModel = MODEL) -> Weather:
    return weather_at_risk(SegmentWind.of(network(), given.field_with_deviations()), model, risk)


def planned_energy(weather: Weather, risk: EnergyRisk, segment: int, at_s: float = 0.0) -> float:
    """The planned energy of a flight, divided by that in still air without a margin."""
    air = weather.air(segment, weather.period_at(at_s))
    return air.time_factor * air.energy_factor * (1 + risk.own_margin)


@given(
    risk=st.tuples(risks, risks).map(sorted),
    use=st.tuples(deviations, deviations).map(sorted),
    in_wind=st.tuples(st.floats(0, 3), st.floats(0, 3)).map(sorted),
)
def test_a_margin_grows_with_less_risk_more_varied_use_and_more_wind(
    risk: list[float], use: list[float], in_wind: list[float]
) -> None:
    careful = EnergyRisk(risk[0], use[1]).margins(np.array([in_wind[1], math.inf]))
    bold = EnergyRisk(risk[1], use[0]).margins(np.array([in_wind[0], math.inf]))

    assert bold[0] <= careful[0] + 1e-12
    assert LEAST_MARGIN <= bold[0] <= MOST_MARGIN
    assert careful[1] == bold[1] == MOST_MARGIN


@given(
    risk=st.tuples(risks, risks).map(sorted),
    use=deviations,
    east_mps=st.floats(-9, 9),
    error_mps=st.tuples(st.floats(0.1, 4), st.floats(0.1, 4)).map(sorted),
)
def test_plans_carry_more_energy_for_less_risk_and_for_a_worse_forecast(
    risk: list[float], use: float, east_mps: float, error_mps: list[float]
) -> None:
    careful, bold = (EnergyRisk(each, use) for each in risk)
    more = weather(forecast(east_mps, error_mps=error_mps[1]), careful)
    less = weather(forecast(east_mps, error_mps=error_mps[0]), bold)

    for segment in (EAST, WEST, NORTH):
        time_factor = more.air(segment, 2).time_factor
        if math.isinf(time_factor):
            continue
        planned = planned_energy(more, careful, segment)
        # Each margin and factor is rounded up by less than 0.01.
        assert planned_energy(less, bold, segment) <= 1.03 * planned
        assert planned <= 1.03 * (1 + MOST_MARGIN) * max(1.0, time_factor)
        assert planned_energy(less, bold, segment) >= 1 + LEAST_MARGIN - 1e-9


def test_the_three_deviations_add_up_by_their_squares() -> None:
    risk = EnergyRisk(0.01, 0.06)
    wind = 0.05

    (margin,) = risk.margins(np.array([wind * risk.deviations]))

    together = math.sqrt(wind**2 + 0.06**2 + MODEL_DEVIATION**2)
    assert risk.deviations == pytest.approx(2.3263, abs=1e-4)
    assert math.log(1 + margin) == pytest.approx(2.3263 * together, rel=1e-4)


def test_the_error_of_the_wind_costs_more_against_it_and_takes_no_time() -> None:
    risk = EnergyRisk(0.01, 0.02)

    windy = weather(forecast(-4.0, error_mps=0.5), risk)
    calm = weather(forecast(0.0, error_mps=0.5), risk)

    # 10 m/s against 4 m/s.
    assert windy.air(EAST, 2).time_factor == pytest.approx(1.67)
    assert windy.air(EAST, 2).energy_factor > calm.air(EAST, 2).energy_factor > 1.0
    # With this error the wind is still a tail wind, so the error costs nothing. Nothing is saved.
    assert windy.air(WEST, 2).time_factor * windy.air(WEST, 2).energy_factor == pytest.approx(
        1.0, abs=0.01
    )


def test_cold_air_costs_energy_beside_the_margin() -> None:
    risk = EnergyRisk(0.01)

    factors = [
        weather(forecast(0.0, temperature_c=each), risk).air(EAST, 2).energy_factor
        for each in (15.0, 0.0)
    ]

    assert factors[1] / factors[0] == pytest.approx(1.1, abs=0.01)


def test_before_and_after_a_forecast_the_margin_is_that_without_a_forecast(
    model: DroneModel,
) -> None:
    risk = EnergyRisk(0.05, 0.04)
    fast = model.model_copy(update={"speed_empty_mps": 40.0, "speed_full_mps": 40.0})

    found = weather(forecast(0.0, error_mps=1.0), risk, fast)

    ends_s = 3600.0 + len(FADING) * FADING_S
    without = 1 + risk.climate_margin(fast)
    energies = [
        planned_energy(found, risk, EAST, at) for at in (-1e6, 0.0, ends_s - 1, ends_s, 1e9)
    ]
    assert energies[0] == energies[3] == energies[4] == pytest.approx(without, abs=0.012)
    # The last hours of a forecast that fades are hardly better than no forecast.
    assert energies[1] < energies[2] == pytest.approx(without, abs=0.012)


def test_without_a_forecast_a_slow_drone_has_the_largest_margin(model: DroneModel) -> None:
    risk = EnergyRisk(0.001)
    slow = model.model_copy(update={"speed_empty_mps": 3.0 * CLIMATE_MPS})

    assert risk.in_climate(slow) == math.inf
    assert risk.climate_margin(slow) == MOST_MARGIN


def test_a_plan_at_a_risk_is_proven_and_carries_the_margin(make_problem: Any) -> None:
    still, risk = make_problem("a-b:4", "b"), EnergyRisk(0.01)
    careful = MODEL.model_copy(update={"power_empty_w": 100.0 * (1 + risk.own_margin)})
    wind = SegmentWind.of(still.network, forecast(-2.0, error_mps=0.5).field_with_deviations())
    air = weather_at_risk(wind, MODEL, risk)
    drone = still.drone.model_copy(update={"model": careful})
    problem = still.model_copy(update={"drone": drone, "weather": air})

    plan = compose(problem)

    assert plan.status == "optimal"
    assert verify(problem, plan) == ()
    (flight,) = (step for step in plan.steps if isinstance(step, Fly))
    air_of_flight = air.air_between("a", "b", at_s=flight.start_s)
    assert (flight.time_factor, flight.energy_factor) == air_of_flight
    most = air_of_flight.time_factor * air_of_flight.energy_factor * (1 + risk.own_margin)
    assert flight.energy_j == pytest.approx(40_000 * most)
