"""What is known of the air on a plan's flights, and how late it makes the plan."""

import numpy as np
import pytest

from skyway.delivery.plan import Fly
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.network import Network, Segment, Station
from skyway.planner.forecast import FADING_S, MILD_C, Forecast
from skyway.planner.known_air import air_in_forecast
from skyway.planner.wind import SegmentWind

WEST, EAST = StationId("west"), StationId("east")
NETWORK = Network(
    {
        WEST: Station(station_id=WEST, position=Position(0.0, 0.0), pads=1),
        EAST: Station(station_id=EAST, position=Position(0.1, 0.0), pads=1),
    },
    [
        Segment(from_id=WEST, to_id=EAST, length_m=11_120.0),
        Segment(from_id=EAST, to_id=WEST, length_m=11_120.0),
    ],
)
MODEL = DJI_MATRICE_300_RTK


def flight(from_id: StationId, to_id: StationId, *, lasting_s: float = 600.0) -> Fly:
    return Fly(
        from_id=from_id,
        to_id=to_id,
        start_s=0.0,
        end_s=lasting_s,
        load_kg=0.0,
        soc_end=0.8,
        energy_j=1.0,
    )


def forecast(east_mps: float, *, temperature_c: float = 15.0) -> Forecast:
    """One hour, the same everywhere."""
    one = np.ones((1, 1))
    return Forecast(
        np.zeros(1),
        np.zeros(1),
        np.array([0.0, 3_600.0]),
        east_mps * one,
        0.0 * one,
        0.0 * one,
        temperature_c * one,
        0.0 * one,
    )


def test_a_plan_is_late_by_the_error_of_its_wind_alone() -> None:
    known = forecast(-5.0, temperature_c=-8.0)
    wind = SegmentWind.of(NETWORK, known.field())

    air = air_in_forecast(known, wind, MODEL, [flight(WEST, EAST)], start_s=0.0)

    assert (air.known.source, air.known.wind_mps, air.known.temperature_c) == ("FORECAST", 5.0, -8)
    slowest_mps = min(MODEL.speed_empty_mps, MODEL.speed_full_mps)
    ground_mps = slowest_mps - 5.0
    late_share = ground_mps / (ground_mps - 1.2816 * 1.5) - 1
    assert air.late_share == pytest.approx(late_share, abs=1e-3)


def test_longer_flights_count_more() -> None:
    known = forecast(-5.0)
    wind = SegmentWind.of(NETWORK, known.field())
    flights = [flight(WEST, EAST, lasting_s=900.0), flight(EAST, WEST, lasting_s=300.0)]

    both, against, behind = (
        air_in_forecast(known, wind, MODEL, flown, start_s=0.0).late_share
        for flown in (flights, flights[:1], flights[1:])
    )

    assert behind < against
    assert both == pytest.approx(0.75 * against + 0.25 * behind, abs=1e-3)


def test_the_temperature_of_a_forecast_fades_to_mild_after_its_end() -> None:
    cold = forecast(0.0, temperature_c=-9.0)

    moments_s = [-1.0, 0.0, 3_600.0, 3_600.0 + FADING_S, 3_600.0 + 4 * FADING_S]
    found = [cold.mean_temperature_c(each) for each in moments_s]
    assert found == [MILD_C, -9.0, MILD_C - 12.0, MILD_C - 6.0, MILD_C]
