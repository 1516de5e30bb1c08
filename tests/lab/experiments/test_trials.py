import math
from dataclasses import replace

import pytest
from skyway_lab.experiments.instances import Setting
from skyway_lab.experiments.trials import RowsOfOtherTrials, Trial, best_s, gap, hold


def test_the_gap_is_against_the_earliest_plan(make_run):
    runs = [make_run(delivery_s=110.0), make_run(delivery_s=100.0), make_run(delivery_s=None)]

    assert [gap(run, best_s(runs)) for run in runs] == [pytest.approx(0.1), 0.0, math.inf]


def test_without_any_plan_there_is_no_gap(make_run):
    assert gap(make_run(delivery_s=None), best_s([make_run(delivery_s=None)])) == 0.0


def test_a_contest_can_be_divided_by_size(make_run, make_contest):
    contest = make_contest([(10, [make_run()]), (20, [make_run()]), (10, [make_run()])])

    by_size = contest.by(lambda setting: setting.stations)

    assert {size: len(cell.runs("exact")) for size, cell in by_size.items()} == {10: 2, 20: 1}


def test_a_baseline_counts_only_where_it_finished_with_a_plan(make_run, make_contest):
    late = make_run("heuristic", delivery_s=150.0)
    baselines = (
        make_run("exhaustive", delivery_s=100.0),
        make_run("exhaustive", delivery_s=100.0, is_censored=True),
        make_run("exhaustive", delivery_s=None),
    )
    contest = make_contest([(10, [baseline, late]) for baseline in baselines])

    assert contest.gaps_to("exhaustive", "heuristic").values == (pytest.approx(0.5),)
    assert contest.has_limited("exhaustive")
    assert not contest.has_limited("heuristic")


def test_a_laboratory_that_redraws_reads_the_rows_of_the_run_before(laboratory, make_run):
    def run(trial):
        return [make_run(delivery_s=None), make_run("heuristic", elapsed_s=trial.seed / 3)]

    trials = [Trial(Setting(), seed=seed, turn=0, contestants=(), limit_s=1.0) for seed in (1, 2)]
    measured = hold(laboratory, "part", trials, run)

    redrawn = hold(replace(laboratory, redraws=True), "part", trials)

    assert redrawn == measured
    with pytest.raises(RowsOfOtherTrials):
        hold(replace(laboratory, redraws=True), "part", trials[::-1])
