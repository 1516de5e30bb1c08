"""The wind that drones measure: who has a vote, and how long a correction counts."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skyway.planner.forecast import Forecast
from skyway.planner.measured_wind import Measurement, corrected, corrections_of

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
