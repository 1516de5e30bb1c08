"""The order of a fleet's trips by OR-Tools' routing solver."""

from typing import Any

from ortools.constraint_solver import pywrapcp, routing_enums_pb2
from skyway_lab.benchmarks.dispatch.routing_task import HORIZON_S, RoutingTask, alone

from skyway.dispatch.schedule import Sequences
from skyway.planner.stop import processor_stopwatch

#: OR-Tools' own limit counts wall time; it only ends a search whose processor is busy with others.
_MOST_WALL: int = 20


def ordered_by_ortools(task: RoutingTask, *, budget_s: float, seed: int) -> Sequences:
    """The sequences that guided local search finds in these seconds of processor time.

    The solver makes the sum of the ends of all trips small; an end counts only after the drone's
    credit is used up. It has no seed.
    """
    del seed
    count, fleet = task.requests, task.drones
    # Nodes: requests, then the start of each drone, then one end for all.
    starts, ends = [count + each for each in range(fleet)], [count + fleet] * fleet
    manager = pywrapcp.RoutingIndexManager(count + fleet + 1, fleet, starts, ends)
    routing = pywrapcp.RoutingModel(manager)
    nothing = [0] * (fleet + 1)
    matrix = [[*row, *nothing] for row in task.needs_s] + [[0] * (count + fleet + 1)]
    number = routing.RegisterTransitMatrix(matrix)
    routing.AddDimension(number, 0, 2 * HORIZON_S, False, "need")
    need = routing.GetDimensionOrDie("need")
    for vehicle, begin_s in enumerate(task.begins_s):
        need.CumulVar(routing.Start(vehicle)).SetValue(begin_s)
    for node in range(count):
        need.SetCumulVarSoftUpperBound(manager.NodeToIndex(node), HORIZON_S, 1)
    search = pywrapcp.DefaultRoutingSearchParameters()
    search.first_solution_strategy = (
        routing_enums_pb2.FirstSolutionStrategy.PARALLEL_CHEAPEST_INSERTION
    )
    search.local_search_metaheuristic = (
        routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    )
    search.time_limit.FromMilliseconds(max(1, round(1000 * _MOST_WALL * budget_s)))
    elapsed_s = processor_stopwatch()
    routing.AddSearchMonitor(routing.solver().CustomLimit(lambda: elapsed_s() >= budget_s))
    solution = routing.SolveWithParameters(search)
    if solution is None:
        return ((),) * fleet
    return tuple(alone(_route(routing, manager, solution, vehicle)) for vehicle in range(fleet))


# OR-Tools' classes have no types.
def _route(routing: Any, manager: Any, solution: Any, vehicle: int) -> list[int]:
    found = []
    index = solution.Value(routing.NextVar(routing.Start(vehicle)))
    while not routing.IsEnd(index):
        found.append(manager.IndexToNode(index))
        index = solution.Value(routing.NextVar(index))
    return found
