"""Times of several runs put together."""

from skyway_lab.benchmarks.planner.distribution import Distribution


def test_a_run_that_was_cut_off_counts_as_later_than_all() -> None:
    times = Distribution.of([1.0, 2.0, 3.0], cut_off=1)

    assert (times.median_ms, times.max_ms) == (2.0, None)


def test_the_text_says_how_many_finished_where_not_all_did() -> None:
    times = Distribution.of([1.0, 2.0, 3.0], cut_off=1)

    assert times.as_text() == "2.0 / limit / limit (3 of 4)"


def test_the_text_of_finished_runs_is_their_quantiles() -> None:
    times = Distribution.of([float(number) for number in range(1, 21)])

    assert times.as_text() == "10 / 19 / 20"
