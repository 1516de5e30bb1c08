"""Exact plans beside what the paper's contestants find on the same problems."""

import pytest

from skyway.planner import compose
from tests.library.planner.oracles.instances import make_problem
from tests.library.planner.oracles.judge import disagreements_with_contestants
from tests.long_cases import sampled


@pytest.mark.parametrize("first", sampled(range(5025, 5100, 25), every=3))
def test_no_contestant_delivers_earlier(first: int) -> None:
    faults = {}
    for seed in range(first, first + 25):
        problem = make_problem(seed)
        faults[seed] = disagreements_with_contestants(problem, compose(problem), most_labels=1000)

    assert {seed: words for seed, words in faults.items() if words} == {}
