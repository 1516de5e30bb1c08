"""The most that a later plan could save is a share of what the earliest plan uses."""

import pytest
from skyway_lab.benchmarks.planner.energy import saved


@pytest.mark.parametrize("packages", [1, 3])
def test_no_plan_uses_less_than_the_least_energy(packages: int) -> None:
    shares = [share for seed in range(3) for share in saved(seed, packages)]

    assert len(shares) == 6
    assert all(-1e-9 <= of_energy < 1.0 and of_time <= 1.0 for of_energy, of_time in shares)
    assert max(of_energy for of_energy, _ in shares) > 0.0
