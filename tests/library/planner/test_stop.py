from skyway.planner.stop import Effort, LabelLimit, TimeLimit, first_of, never, stopwatch


def test_effort_is_spent_with_the_last_label_of_the_limit():
    effort = Effort(LabelLimit(3))

    assert [effort.is_spent() for _ in range(4)] == [False, False, True, True]
    assert effort.labels == 4


def test_a_stop_learns_how_many_labels_remain():
    told: list[int] = []
    effort = Effort(lambda labels: bool(told.append(labels)), most_labels=3)

    assert [effort.has_made(2), effort.has_made(1)] == [False, True]
    assert told == [2, 3]


def test_a_time_limit_of_zero_is_over_immediately_and_a_long_one_is_not():
    assert TimeLimit(0.0)(0)
    assert not TimeLimit(3600.0)(10**9)


def test_the_first_of_several_stops_counts():
    stop = first_of(never, LabelLimit(2))

    assert (stop(1), stop(2)) == (False, True)


def test_a_stopwatch_never_runs_backwards():
    elapsed_s = stopwatch()

    assert 0 <= elapsed_s() <= elapsed_s()
