from skyway.planner.stop import Effort, LabelLimit, TimeLimit, first_of, never, stopwatch


def test_effort_is_spent_with_the_last_label_of_the_limit():
    effort = Effort(LabelLimit(3))

    assert [effort.is_spent() for _ in range(4)] == [False, False, True, True]
    assert effort.labels == 4


def test_a_stop_receives_the_number_of_labels_made_so_far():
    asked_with: list[int] = []

    def record(labels: int) -> bool:
        asked_with.append(labels)
        return False

    effort = Effort(record, most_labels=3)

    assert [effort.has_made(2), effort.has_made(1)] == [False, True]
    assert asked_with == [2, 3]


def test_a_time_limit_of_zero_is_over_immediately_and_a_long_one_is_not():
    assert TimeLimit(0.0)(0)
    assert not TimeLimit(3600.0)(10**9)


def test_combined_stops_end_with_the_first_of_them():
    stop = first_of(never, LabelLimit(2))

    assert (stop(1), stop(2)) == (False, True)


def test_a_stopwatch_never_runs_backwards():
    elapsed_s = stopwatch()

    assert 0 <= elapsed_s() <= elapsed_s()
