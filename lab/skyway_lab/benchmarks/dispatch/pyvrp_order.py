"""The order of a fleet's trips by PyVRP."""

from pyvrp import Model
from skyway_lab.benchmarks.dispatch.routing_task import RUNS, RoutingTask, alone

from skyway.dispatch.schedule import Sequences
from skyway.planner.stop import processor_stopwatch


def ordered_by_pyvrp(task: RoutingTask, *, budget_s: float, seed: int) -> Sequences:
    """The best order of several runs with hard ends; together they use this processor time.

    PyVRP makes the sum of all needs small.
    """

    def order(end_s: int) -> Sequences | None:
        elapsed_s = processor_stopwatch()
        result = _model(task, end_s).solve(
            lambda _cost: elapsed_s() >= budget_s / RUNS, seed=seed, display=False
        )
        if not result.is_feasible():
            return None
        found: list[list[int]] = [[] for _ in range(task.drones)]
        for route in result.best.routes():
            found[route.vehicle_type()] = [each.idx for each in route if each.is_client()]
        return tuple(map(alone, found))

    return task.best_with_ends(order)


def _model(task: RoutingTask, end_s: int) -> Model:
    """Each drone is a type of vehicle of its own, and flies to the common end in no time."""
    model = Model()
    clients = [model.add_location(0, 0) for _ in range(task.requests)]
    for each in clients:
        model.add_client(each)
    starts = [model.add_location(0, 0) for _ in range(task.drones)]
    end = model.add_location(0, 0)
    depots = [model.add_depot(each) for each in (*starts, end)]
    for number, begin_s in enumerate(task.begins_s):
        model.add_vehicle_type(
            1,
            start_depot=depots[number],
            end_depot=depots[-1],
            tw_early=begin_s,
            tw_late=end_s,
        )
    leaving = [*clients, *starts]
    for one, row in zip(leaving, task.needs_s, strict=True):
        for other, need_s in zip(clients, row, strict=True):
            if one is not other:
                model.add_edge(one, other, distance=need_s, duration=need_s)
        model.add_edge(one, end, distance=0, duration=0)
    return model
