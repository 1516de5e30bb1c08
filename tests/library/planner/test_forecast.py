"""A forecast: what counts between its places, after its end, and in a tail wind."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skyway.drone.model import DroneModel
from skyway.geo import Position, distance_m, wrapped_deg
from skyway.ids import StationId
from skyway.network.network import Network, Segment, Station
from skyway.planner.energy_risk import CLIMATE_MPS, FORECAST_ERROR_MPS
from skyway.planner.forecast import FADING, FADING_S, Forecast, planned_weather
from skyway.planner.weather import Weather
from skyway.planner.wind import SegmentWind, weights_of
from tests.library.planner.conftest import MODEL, forecast

A, B = StationId("a"), StationId("b")


@pytest.fixture
def network() -> Network:
    """A segment to the east, and back."""
    stations = {name: Station(name, Position(x, 0.0)) for name, x in ((A, 0.0), (B, 0.1))}
    return Network(stations, [Segment(A, B, 1e4), Segment(B, A, 1e4)])


def weather_of(forecast: Forecast, network: Network, model: DroneModel) -> Weather:
    return planned_weather(SegmentWind.of(network, forecast.field()), model)


def grid(rows: int, columns: int, east_mps: Any) -> Forecast:
    """One period on a grid from (0, 0) to (1, 2) degrees."""
    longitude_deg, latitude_deg = np.linspace(0.0, 2.0, columns), np.linspace(0.0, 1.0, rows)
    places = np.tile(longitude_deg, rows), np.repeat(latitude_deg, columns)
    still = np.zeros((1, rows * columns))
    east = still + east_mps(*places)
    return Forecast(
        *places, np.array([0.0, 1.0]), east, still, still, still, still, (rows, columns)
    )


@given(
    slope=st.tuples(*[st.floats(-5, 5)] * 3),
    shape=st.tuples(st.integers(2, 5), st.integers(2, 5)),
    at=st.tuples(st.floats(0, 2), st.floats(0, 1)),
)
def test_a_grid_counts_between_its_points_in_proportion(
    slope: tuple[float, float, float], shape: tuple[int, int], at: tuple[float, float]
) -> None:
    def linear(x: Any, y: Any) -> Any:
        return slope[0] + slope[1] * x + slope[2] * y

    field = grid(*shape, linear).field()

    weights = weights_of(field, longitude_deg=np.array(at[:1]), latitude_deg=np.array(at[1:]))

    assert weights.of(field.east_mps)[0, 0] == pytest.approx(linear(*at), abs=1e-9)


@pytest.mark.parametrize("shape", [(1, 1), (1, 3), (3, 1), (2, 2)])
def test_beyond_a_grid_its_border_counts(shape: tuple[int, int]) -> None:
    field = grid(*shape, lambda x, y: x + 10 * y).field()

    weights = weights_of(
        field, longitude_deg=np.array([-9.0, 9.0]), latitude_deg=np.array([-9.0, 9.0])
    )

    corners = field.east_mps[0, [0, -1]]
    assert weights.of(field.east_mps)[0].tolist() == pytest.approx(corners.tolist())


def test_only_the_nearest_of_many_places_count() -> None:
    many = grid(20, 20, lambda x, y: x)
    field = Forecast(
        many.longitude_deg,
        many.latitude_deg,
        many.edges_s,
        many.east_mps,
        many.north_mps,
        many.gust_mps,
        many.temperature_c,
        many.error_mps,
    ).field()

    weights = weights_of(field, longitude_deg=np.array([0.7]), latitude_deg=np.array([0.5]))

    assert weights.place.shape == (8, 1)
    assert weights.of(field.east_mps)[0, 0] == pytest.approx(0.7, abs=0.05)


def test_an_old_forecast_counts_less_and_less(network: Network, model: DroneModel) -> None:
    weather = weather_of(forecast(-4.0), network, model)

    factors = [weather.air(0, period).time_factor for period in range(7)]
    # 10 m/s against 4, 2, 1, 0.5 and 0.25 m/s.
    left_mps = [4.0, *(4.0 * share for share in FADING)]
    expected = [math.ceil(1000 / (10 - left) - 1e-6) / 100 for left in left_mps]
    assert factors == pytest.approx([1.0, *expected, 1.0])
    assert weather.edges_s[-1] == 3600.0 + len(FADING) * FADING_S


@given(east_mps=st.floats(-9, 9), temperature_c=st.floats(-30, 40))
def test_no_wind_saves_energy(east_mps: float, temperature_c: float) -> None:
    stations = {name: Station(name, Position(x, 0.0)) for name, x in ((A, 0.0), (B, 0.1))}
    network = Network(stations, [Segment(A, B, 1e4), Segment(B, A, 1e4)])

    weather = weather_of(forecast(east_mps, temperature_c=temperature_c), network, MODEL)

    flown = weather.time_factor < math.inf
    assert (weather.time_factor * weather.energy_factor)[flown].min(initial=1.0) >= 1 - 1e-12


def test_gusts_above_the_limit_of_the_model_close_segments(
    network: Network, model: DroneModel
) -> None:
    careful = model.model_copy(update={"max_wind_mps": 6.0})

    for limited, closed in ((careful, True), (model, False)):
        weather = weather_of(forecast(1.0, gust_mps=7.0), network, limited)

        assert weather.closes(A, B, start_s=0.0, end_s=10.0) is closed
        # Half of 7 m/s is left after the end.
        assert not weather.closes(A, B, start_s=3601.0, end_s=3700.0)


def test_wind_above_the_limit_closes_segments_although_the_forecast_names_no_gusts(
    network: Network, model: DroneModel
) -> None:
    careful = model.model_copy(update={"max_wind_mps": 6.0})

    assert weather_of(forecast(7.0), network, careful).closes(A, B, start_s=0.0, end_s=10.0)


def test_the_strongest_wind_counts_the_error_of_the_forecast() -> None:
    assert forecast(3.0, error_mps=2.0).strongest_mps == 5.0


def test_the_deviation_of_the_wind_is_usual_without_an_error_and_grows_after_the_end() -> None:
    stated, usual = (
        forecast(3.0, error_mps=error_mps).field_with_deviations().error_mps[:, 0]
        for error_mps in (0.5, 0.0)
    )

    assert (stated[0], usual[0]) == (0.5, FORECAST_ERROR_MPS)
    assert (np.diff(stated) > 0).all()
    assert stated[-1] == pytest.approx(CLIMATE_MPS, rel=0.01)


def test_cold_air_costs_energy(network: Network, model: DroneModel) -> None:
    weather = weather_of(forecast(0.0, temperature_c=0.0), network, model)

    assert weather.air_between(A, B, at_s=10.0).energy_factor == pytest.approx(1.1)


def test_a_station_far_from_all_places_is_found(network: Network) -> None:
    row, far_m = forecast(1.0).farthest_m(network)

    assert row == 1
    assert far_m == pytest.approx(11_119.5)
    assert grid(2, 2, lambda x, y: x).farthest_m(network)[1] == 0.0


def turned(network: Network, by_deg: float) -> Network:
    stations = {
        name: Station(name, Position(wrapped_deg(longitude_deg + by_deg), latitude_deg))
        for name, one in network.stations.items()
        for longitude_deg, latitude_deg in (one.position,)
    }
    return Network(stations, network.segments)


@pytest.mark.parametrize("is_grid", [True, False])
@given(
    by_deg=st.integers(-180, 180) | st.integers(178, 180) | st.floats(-180, 180),
    places=st.lists(st.tuples(st.floats(-0.4, 2.4), st.floats(-0.4, 1.4)), min_size=2, max_size=6),
)
def test_a_turned_world_has_the_same_wind(
    is_grid: bool, by_deg: float, places: list[tuple[float, float]]
) -> None:
    names = [StationId(f"s{number}") for number in range(len(places))]
    at = zip(names, places, strict=True)
    stations = {name: Station(name, Position(*place)) for name, place in at}
    network = Network(stations, [Segment(a, b, 1e4) for a in names for b in names if a != b])
    values = grid(3, 4, lambda x, y: 3 + np.sin(3 * x) + y)
    here = replace(
        values, north_mps=values.east_mps[:, ::-1], grid=values.grid if is_grid else None
    )
    elsewhere = replace(here, longitude_deg=here.longitude_deg + by_deg)

    wind = SegmentWind.of(network, here.field())
    same = SegmentWind.of(turned(network, by_deg), elsewhere.field())

    # Stations that stand in nearly the same place have no course.
    apart = network.columns.length_m > 0
    far = [
        distance_m(*(stations[end].position for end in (s.from_id, s.to_id))) > 1
        for s in network.segments
    ]
    for name in ("along_mps", "across_mps", "gust_mps", "energy_factor", "error_mps"):
        found, expected = (getattr(each, name)[:, apart & far] for each in (same, wind))
        assert found == pytest.approx(expected, abs=1e-6)
    assert elsewhere.farthest_m(turned(network, by_deg))[1] == pytest.approx(
        here.farthest_m(network)[1], abs=0.1
    )


def test_a_grid_all_around_the_earth_has_no_border() -> None:
    longitude_deg, latitude_deg = np.arange(0.0, 360.0, 10.0), np.array([-1.0, 1.0])
    east_mps = np.tile(np.cos(np.radians(longitude_deg)), 2)[None, :]
    still = np.zeros_like(east_mps)
    field = Forecast(
        np.tile(longitude_deg, 2),
        np.repeat(latitude_deg, 36),
        np.array([0.0, 1.0]),
        east_mps,
        still,
        still,
        still,
        still,
        (2, 36),
    ).field()
    points = np.array([-5.0, 355.0, 5.0, -180.0, 180.0, 175.0, -175.0])

    weights = weights_of(field, longitude_deg=points, latitude_deg=np.zeros(7))

    near_0, near_180 = (1 + math.cos(math.radians(10))) / 2, -1.0
    between = -(1 + math.cos(math.radians(10))) / 2
    assert weights.of(field.east_mps)[0].tolist() == pytest.approx(
        [near_0, near_0, near_0, near_180, near_180, between, between]
    )


def test_a_flight_over_the_pole_has_the_wind_of_its_middle() -> None:
    stations = {name: Station(name, Position(x, 89.9)) for name, x in ((A, -60.0), (B, 119.9))}
    network = Network(stations, [Segment(A, B, 22_000)])
    at = np.array([-60.0, 119.9, 30.0]), np.array([89.9, 89.9, 80.0])
    still = np.zeros((1, 3))
    wind = Forecast(
        *at, np.array([0.0, 1.0]), still, np.array([[0.0, 0.0, 90.0]]), still, still, still
    )

    found = SegmentWind.of(network, wind.field())

    # The place in latitude 80 is a hundred times as far away as the other two.
    assert float(np.hypot(found.along_mps, found.across_mps)[0, 0]) < 0.1
