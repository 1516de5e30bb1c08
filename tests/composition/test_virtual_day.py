"""A day in virtual time, at its smallest."""

import pytest
from skyway_lab.benchmarks.days.day import Trial

from tests.composition.virtual_day import fly_virtually


@pytest.mark.long
async def test_a_stormy_day_with_a_forecast_delivers_and_says_how() -> None:
    trial = Trial(
        "stormy",
        deliveries=1,
        drones=2,
        every_s=180.0,
        clock_rate=120.0,
        seed=2,
        error_mps=1.0,
        reserve_risk=0.05,
    )

    day = await fly_virtually(trial)

    assert {state: each for state, each in day.states.items() if each} == {"COMPLETED": 1}
    assert (len(day.late_min), day.landings_below_reserve, day.down) == (1, 0, 0)
    # The forecast gives a P90 before anything was learned, so the package is less late against it.
    assert day.late_of_due_min[0] < day.late_min[0] - 1
    assert sum(day.replanned_by.values()) == sum(day.new_plans)
