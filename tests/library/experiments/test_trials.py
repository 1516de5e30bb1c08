import math

import pytest

from skyway.experiments.trials import best_s, gap


def test_the_gap_is_against_the_earliest_plan(make_run):
    runs = [make_run(delivery_s=110.0), make_run(delivery_s=100.0), make_run(delivery_s=None)]

    assert [gap(run, best_s(runs)) for run in runs] == [pytest.approx(0.1), 0.0, math.inf]


def test_without_any_plan_there_is_no_gap(make_run):
    assert gap(make_run(delivery_s=None), best_s([make_run(delivery_s=None)])) == 0.0


def test_a_contest_can_be_divided_by_size(make_run, make_contest):
    contest = make_contest([(10, [make_run()]), (20, [make_run()]), (10, [make_run()])])

    by_size = contest.by(lambda setting: setting.stations)

    assert {size: len(cell.runs("exact")) for size, cell in by_size.items()} == {10: 2, 20: 1}
