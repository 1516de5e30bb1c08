"""The wind is the same for all drones, smooth, and as strong as the scenario says."""

from datetime import UTC, datetime, timedelta
from statistics import fmean, pstdev

import pytest
from skyway_drone_agent.simulated.disturbances import Wind
from skyway_drone_agent.simulated.wind_field import WindField, wind_field

from skyway.geo import Position

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)
HERE = Position(-98.0, 30.0)
GUSTS = Wind(mean_mps=5.0, from_deg=270.0, gust_mps=2.0, gust_span_m=1_000, gust_span_s=100)


def scattered(field: WindField) -> list[tuple[float, float]]:
    """The wind at independent places and moments."""
    return [
        field.at(Position(-98.0 + (n % 60) / 3, 30.0 + n / 90), NOON + timedelta(hours=n))
        for n in range(2_000)
    ]


def test_wind_from_the_west_goes_east() -> None:
    east, north = wind_field(Wind(mean_mps=5.0, from_deg=270.0), 1).at(HERE, NOON)

    assert east == pytest.approx(5.0)
    assert north == pytest.approx(0.0, abs=1e-9)


def test_gusts_scatter_around_the_mean_with_the_given_deviation() -> None:
    seen = scattered(wind_field(GUSTS, 1))

    east, north = zip(*seen, strict=True)
    assert fmean(east) == pytest.approx(5.0, abs=0.3)
    assert fmean(north) == pytest.approx(0.0, abs=0.3)
    assert pstdev(east) == pytest.approx(2.0, abs=0.3)
    assert pstdev(north) == pytest.approx(2.0, abs=0.3)


def test_the_wind_close_by_and_soon_after_is_nearly_the_same() -> None:
    field = wind_field(GUSTS, 1)

    here = field.at(HERE, NOON)
    beside = field.at(Position(-98.0, 30.0001), NOON + timedelta(seconds=1))

    assert beside == pytest.approx(here, abs=0.2)


def test_another_seed_is_another_day_and_the_same_seed_the_same() -> None:
    wind_field.cache_clear()
    first = wind_field(GUSTS, 1).at(HERE, NOON)
    wind_field.cache_clear()

    assert wind_field(GUSTS, 1).at(HERE, NOON) == first
    assert wind_field(GUSTS, 2).at(HERE, NOON) != first
