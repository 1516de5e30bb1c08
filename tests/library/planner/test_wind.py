"""What a wind field does to the factors of segments to the east, west and north."""

import math
from typing import Any

import numpy as np
import pytest

from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.network import Network, Segment, Station
from skyway.planner.wind import WindField, weather_of_wind

A, B, C = (StationId(name) for name in "abc")


@pytest.fixture
def network() -> Network:
    """Segments from a to the east, back to the west, and to the north."""
    places = {A: (0.0, 0.0), B: (0.1, 0.0), C: (0.0, 0.1)}
    stations = {name: Station(name, Position(*place)) for name, place in places.items()}
    return Network(stations, [Segment(A, B, 1e4), Segment(B, A, 1e4), Segment(A, C, 1e4)])


def wind(east_mps: float, *, gust_mps: float = 0.0, error_mps: float = 0.0) -> WindField:
    """One period of wind to the east at one place."""
    return WindField(
        longitude_deg=np.zeros(1),
        latitude_deg=np.zeros(1),
        edges_s=np.array([0.0, 3600.0]),
        east_mps=np.full((1, 1), east_mps),
        north_mps=np.zeros((1, 1)),
        gust_mps=np.full((1, 1), gust_mps),
        energy_factor=np.full((1, 1), 1.05),
        error_mps=np.full((1, 1), error_mps),
    )


def factors(network: Network, model: DroneModel, field: WindField) -> Any:
    return weather_of_wind(network, model, field, limit_mps=12.0).time_factor[0].tolist()


def test_wind_helps_hinders_and_drives_across(network: Network, model: DroneModel) -> None:
    expected = [10 / 14, 10 / 6, 10 / math.sqrt(100 - 16)]

    found = factors(network, model, wind(4.0))

    assert found == pytest.approx([math.ceil(100 * one) / 100 for one in expected])


def test_the_load_that_the_wind_hinders_most_counts(network: Network, model: DroneModel) -> None:
    slow_when_full = model.model_copy(update={"speed_full_mps": 8.0})

    assert factors(network, slow_when_full, wind(4.0))[:2] == pytest.approx([0.72, 2.0])


def test_an_error_counts_as_wind_against_the_drone(network: Network, model: DroneModel) -> None:
    assert factors(network, model, wind(4.0, error_mps=4.0))[:2] == pytest.approx([1.0, 5.0])


@pytest.mark.parametrize("field", [wind(0.0, gust_mps=12.1), wind(-9.5), wind(-30.0)])
def test_too_strong_a_wind_closes_a_segment(
    network: Network, model: DroneModel, field: WindField
) -> None:
    assert factors(network, model, field)[0] == math.inf


def test_energy_rises_beside_the_wind(network: Network, model: DroneModel) -> None:
    weather = weather_of_wind(network, model, wind(4.0), limit_mps=12.0)

    assert weather.energy_factor.tolist() == [pytest.approx([1.05, 1.05, 1.05])]
