"""Exact plans before the mixed-integer model (HiGHS), on networks of up to 10 stations."""

import pytest

from skyway.planner import compose
from tests.library.planner.oracles.instances import make_open_problem
from tests.library.planner.oracles.judge import disagreements_with_milp
from tests.long_cases import sampled

#: Seeds that HiGHS settles within a second, with several recharges, windows and both policies.
_SEEDS = range(25)


@pytest.mark.parametrize("seed", sampled(_SEEDS, every=5))
def test_the_time_is_that_of_the_mixed_integer_model(seed: int) -> None:
    problem = make_open_problem(seed)

    assert disagreements_with_milp(problem, compose(problem)) == []
