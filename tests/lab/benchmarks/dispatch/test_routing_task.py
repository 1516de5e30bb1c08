"""The task that other routing solvers receive, and the choice among a solver's answers."""

from itertools import pairwise

from skyway_lab.benchmarks.dispatch.routing_task import HORIZON_S, RUNS, RoutingTask, alone

from skyway.dispatch.estimates import Estimates
from skyway.dispatch.pools import Sharing
from skyway.dispatch.schedule import Sequences
from tests.library.dispatch.fleets import MODEL, small_fleet


def make_task() -> RoutingTask:
    problem = small_fleet(3, drones=2, requests=4)
    return RoutingTask.of(problem, Estimates(problem, [MODEL], sharing=Sharing(problem)))


def test_the_cheapest_answer_with_the_earliest_ends_is_chosen():
    task = make_task()
    answers: dict[int, Sequences] = {}

    def order(end_s: int) -> Sequences | None:
        first = len(answers) % 4
        answers[end_s] = (alone(range(first)), alone(range(first, 4)))
        return answers[end_s]

    best = task.best_with_ends(order)

    ends = list(answers)
    assert len(ends) == RUNS
    assert all(HORIZON_S < later < end for end, later in pairwise(ends))
    assert task.estimated_s(best) == min(map(task.estimated_s, answers.values()))


def test_a_solver_that_never_serves_all_requests_orders_nothing():
    task = make_task()

    assert task.best_with_ends(lambda _end_s: None) == ((), ())


def test_needs_of_a_drone_that_begins_charged_start_before_it_is_free():
    task = make_task()

    assert [len(row) for row in task.needs_s] == [4] * 6
    for drone, begin_s in zip(task.problem.drones, task.begins_s, strict=True):
        assert begin_s < HORIZON_S + drone.free_s
