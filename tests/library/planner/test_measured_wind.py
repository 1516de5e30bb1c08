"""The wind that drones measure: who has a vote, how much it counts, and how long."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skyway.planner.forecast import Forecast
from skyway.planner.measured_wind import MeasuredAir, Measurement, air_of, corrected, corrections_of

_WIND = st.floats(-80, 80)


def forecast(*, hours: int = 4) -> Forecast:
    """Still air at (0, 0) and at (2, 0), hour by hour from 0 on."""
    still = np.zeros((hours, 2))
    return Forecast(
        np.array([0.0, 2.0]),
        np.zeros(2),
        3_600.0 * np.arange(hours + 1, dtype=np.float64),
        still,
        still,
        still,
        still,
        still,
    )


def measured(provider_id: str, east_mps: float, **members: Any) -> Measurement:
    values = {"longitude_deg": 0.1, "latitude_deg": 0.0, "at_s": 100.0, "north_mps": 0.0}
    return Measurement(provider_id=provider_id, east_mps=east_mps, **{**values, **members})


@given(lies=st.lists(_WIND, min_size=1, max_size=20))
def test_one_provider_alone_changes_nothing(lies: list[float]) -> None:
    said = [measured("liar", each) for each in lies]

    assert corrections_of(forecast(), said, now_s=200.0) == {}


@given(lies=st.lists(_WIND, max_size=20), truth=st.floats(-10, 10))
def test_a_lying_provider_cannot_push_beyond_what_others_say(
    lies: list[float], truth: float
) -> None:
    said = [measured("honest", truth), *(measured("liar", each) for each in lies)]

    found = corrections_of(forecast(), said, now_s=200.0).get(0, (0.0, 0.0))

    least, most = sorted((0.0, truth))
    assert least - 0.25 <= found[0] <= most + 0.25


def test_providers_that_agree_correct_the_places_near_them() -> None:
    said = [measured("one", 4.1), measured("one", 60.0), measured("one", 3.9), measured("two", 4.6)]

    assert corrections_of(forecast(), said, now_s=200.0) == {0: (4.0, 0.0)}


@pytest.mark.parametrize("members", [{"at_s": -900.0}, {"longitude_deg": 1.0}])
def test_old_and_distant_measurements_do_not_count(members: dict[str, float]) -> None:
    said = [measured(name, 4.0, **members) for name in ("one", "two")]

    assert corrections_of(forecast(), said, now_s=200.0) == {}


def test_a_correction_is_halved_with_each_hour() -> None:
    found = corrected(forecast(), {0: (4.0, -2.0)}, at_s=5_400.0)

    assert found.east_mps[:, 0].tolist() == pytest.approx(
        [0.0, 4.0, 4.0 * 0.5**0.5, 2.0 * 0.5**0.5]
    )
    assert found.north_mps[1].tolist() == [-2.0, 0.0]


def test_the_air_of_a_network_is_the_median_of_its_providers() -> None:
    large = [measured("large", 20.0, north_mps=1.0)] * 50
    others = [measured(name, each, north_mps=1.0) for name, each in (("one", 3.0), ("two", 3.3))]

    assert air_of([*large, *others], now_s=200.0) == MeasuredAir(3.5, 1.0, drones=52)
    assert air_of(others, now_s=3_600.0) is None


@given(lies=st.lists(_WIND, min_size=1, max_size=20), truth=st.floats(-10, 10))
def test_of_two_providers_the_one_nearer_to_still_air_counts(
    lies: list[float], truth: float
) -> None:
    said = [measured("honest", truth), *(measured("liar", each) for each in lies)]

    air = air_of(said, now_s=200.0)

    assert air is not None
    assert abs(air.east_mps) <= abs(truth) + 0.25


@given(east_mps=_WIND, north_mps=_WIND, temperature_c=st.floats(-273, 10_000))
def test_one_provider_alone_reports_no_storm_and_no_impossible_cold(
    east_mps: float, north_mps: float, temperature_c: float
) -> None:
    lie = measured("liar", east_mps, north_mps=north_mps, temperature_c=temperature_c)

    air = air_of([lie], now_s=200.0)

    assert air is not None
    assert np.hypot(air.east_mps, air.north_mps) <= 10.4
    assert -20 <= air.temperature_c <= 60


def test_the_mean_of_two_winds_is_in_steps_and_ends_in_still_air() -> None:
    air = MeasuredAir(8.0, -3.0)

    assert air.averaged((5.0, 0.0)) == MeasuredAir(6.5, -1.5)
    assert MeasuredAir(0.0, 0.0).averaged((0.5, -0.5)) == MeasuredAir(0.0, 0.0)


def test_the_error_of_measured_wind_is_that_of_gusts_and_of_few_drones() -> None:
    assert MeasuredAir(6.0, -8.0, drones=100).error_mps == 3.0
    assert MeasuredAir(6.0, -8.0, drones=1).error_mps == 4.5
    assert MeasuredAir(0.0, 0.0).error_mps == 0.0
