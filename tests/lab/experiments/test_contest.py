import pytest
from skyway_lab.experiments.contest import EXACT, EXHAUSTIVE, HEURISTIC, contest, run
from skyway_lab.experiments.instances import Setting, city_problem
from skyway_lab.experiments.plain_python import PlainPython

PROBLEM = city_problem(Setting(stations=8), seed=2)


@pytest.mark.parametrize("turn", [0, 1, 2])
def test_runs_have_the_order_of_their_names_in_every_turn(turn):
    runs = contest(PROBLEM, (HEURISTIC, EXHAUSTIVE, EXACT), limit_s=20, turn=turn)

    assert [run.contestant for run in runs] == [HEURISTIC, EXHAUSTIVE, EXACT]


def test_a_run_that_its_limit_ends_is_censored():
    many = city_problem(Setting(stations=30, degree=5, packages=4), seed=1)

    ended = run(many, EXHAUSTIVE, limit_s=0.05)

    assert ended.is_censored
    assert ended.elapsed_s >= 0.05


def test_exhaustive_counts_the_routes_that_it_simulates():
    counted = run(PROBLEM, EXHAUSTIVE, limit_s=20)

    assert 0 < counted.compositions < counted.labels


def test_plain_python_finds_the_same_as_the_compiled_code():
    compiled = run(PROBLEM, EXACT, limit_s=20)

    with PlainPython() as plain:
        plan = plain.compose(PROBLEM.model_copy(update={"strategy": EXACT}))

    assert plan.delivery_time_s == compiled.delivery_s
    assert plan.stats["labels"] == compiled.labels
