import pytest
from skyway_lab.experiments.claims import (
    LEAST_SOLVED,
    grows_exponentially,
    is_far_faster,
    is_near_optimal,
)
from skyway_lab.experiments.sample import Sample

SIZES = (10, 15, 20, 25, 30)


@pytest.fixture
def make_growth(make_run, make_contest):
    def make(time_s):
        return make_contest(
            [
                (size, [make_run("exhaustive", elapsed_s=time_s(size) * (1 + 0.01 * number))])
                for size in SIZES
                for number in range(6)
            ]
        )

    return make


def test_time_that_doubles_every_three_stations_grows_exponentially(make_growth):
    assert grows_exponentially(make_growth(lambda size: 2 ** (size / 3)), seed=1).answer == "holds"


def test_time_that_doubles_every_twenty_stations_does_not(make_growth):
    assert grows_exponentially(make_growth(lambda size: 2 ** (size / 20)), seed=1).answer == "fails"


def test_slow_growth_among_censored_runs_proves_nothing(make_run, make_contest):
    contest = make_contest(
        [(size, [make_run("exhaustive", is_censored=True)]) for size in SIZES for _ in range(6)]
    )

    finding = grows_exponentially(contest, seed=1)

    assert finding.answer == "open"


@pytest.mark.parametrize(("slow_s", "answer"), [(20.0, "holds"), (5.0, "fails")])
def test_far_faster_is_ten_times(make_run, make_contest, slow_s, answer):
    runs = [make_run("exhaustive", elapsed_s=slow_s), make_run("heuristic", elapsed_s=1.0)]
    contest = make_contest([(20, runs)] * 30)

    assert is_far_faster(contest, seed=1).answer == answer


@pytest.mark.parametrize(
    ("gaps", "answer"),
    [
        ([0.0, 0.01, 0.02, 0.03] * 8, "holds"),
        ([0.3, 0.4] * 15, "fails"),
        ([0.0] * 28 + [9.0, 9.0], "open"),
    ],
)
def test_near_optimal_means_the_median_and_the_95th_percentile(gaps, answer):
    assert is_near_optimal(Sample.of(gaps), seed=1).answer == answer


def test_a_claim_on_too_few_solved_instances_is_open(make_run, make_contest):
    few = LEAST_SOLVED - 1
    fast = [make_run("exhaustive", elapsed_s=20.0), make_run("heuristic", elapsed_s=1.0)]
    solved = [(20 + n % 2 * 10, [make_run("exhaustive", elapsed_s=1.0 + n)]) for n in range(few)]
    unsolved = [(30, [make_run("exhaustive", is_censored=True)])] * 30

    found = [
        is_near_optimal(Sample.of([0.0] * few), seed=1),
        is_near_optimal(Sample.of([9.0] * few), seed=1),
        is_far_faster(make_contest([(20, fast)] * few), seed=1),
        grows_exponentially(make_contest([*solved, *unsolved]), seed=1),
    ]

    assert {finding.answer for finding in found} == {"open"}
    assert all(f"{few} solved, {LEAST_SOLVED} needed" in finding.measured for finding in found)
