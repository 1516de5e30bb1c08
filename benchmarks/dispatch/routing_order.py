"""The order of a fleet's trips by OR-Tools' routing solver, on the same estimates as ours."""

from typing import Any, Final

from skyway.dispatch.estimates import Estimates
from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.schedule import Sequences
from skyway.planner.kernels.fleet_trips import NEED

#: No plan takes longer, seconds.
_HORIZON_S: Final = 1_000_000


def ordered_by_ortools(
    problem: FleetProblem, estimates: Estimates, *, budget_s: float
) -> Sequences:
    """The sequences that guided local search finds in this many seconds.

    Its clock counts the need of flights: their time plus the time to charge their energy. A drone
    begins with its charge as credit. The solver makes the sum of the ends of all trips small; an
    end counts only after the drone's credit is used up. All drones are of one model.
    """
    # Late: an extra of the benchmarks.
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2

    drones, requests = problem.drones, problem.requests
    if not requests:
        return ((),) * len(drones)
    count, fleet = len(requests), len(drones)
    # Nodes: requests, then the start of each drone, then one end for all.
    starts, ends = [count + each for each in range(fleet)], [count + fleet] * fleet
    manager = pywrapcp.RoutingIndexManager(count + fleet + 1, fleet, starts, ends)
    routing = pywrapcp.RoutingModel(manager)
    matrix: list[list[int]] = _needs(problem, estimates)

    def transit(one: int, other: int) -> int:
        row: list[int] = matrix[manager.IndexToNode(one)]
        return int(row[manager.IndexToNode(other)])

    number = routing.RegisterTransitCallback(transit)
    routing.AddDimension(number, 0, 2 * _HORIZON_S, False, "need")
    need = routing.GetDimensionOrDie("need")
    for vehicle, drone in enumerate(drones):
        begun_s = _HORIZON_S + drone.free_s - estimates.credit_s(0, drone.soc)
        need.CumulVar(routing.Start(vehicle)).SetValue(round(begun_s))
    for node in range(count):
        need.SetCumulVarSoftUpperBound(manager.NodeToIndex(node), _HORIZON_S, 1)
    search = pywrapcp.DefaultRoutingSearchParameters()
    search.first_solution_strategy = (
        routing_enums_pb2.FirstSolutionStrategy.PARALLEL_CHEAPEST_INSERTION
    )
    search.local_search_metaheuristic = (
        routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    )
    search.time_limit.FromMilliseconds(max(1, round(1000 * budget_s)))
    solution = routing.SolveWithParameters(search)
    if solution is None:
        return ((),) * fleet
    return tuple(_sequence(routing, manager, solution, vehicle) for vehicle in range(fleet))


def _sequence(routing: Any, manager: Any, solution: Any, vehicle: int) -> tuple[tuple[int], ...]:
    found = []
    index = solution.Value(routing.NextVar(routing.Start(vehicle)))
    while not routing.IsEnd(index):
        found.append((manager.IndexToNode(index),))
        index = solution.Value(routing.NextVar(index))
    return tuple(found)


def _needs(problem: FleetProblem, estimates: Estimates) -> list[list[int]]:
    """Whole seconds from the end of each node to the end of each other node."""
    place_of, approach = estimates.place_of, estimates.approach(0)
    trips = [estimates.trip(0, (each,)) for each in range(len(problem.requests))]
    leaving = [each.best_end for each in trips]
    leaving += [place_of[each.station_id] for each in problem.drones]
    rows = []
    for row, place in enumerate(leaving):
        pause_s = problem.hand_over_s if row < len(trips) else 0.0
        rows.append(
            [
                round(pause_s + approach[place, place_of[request.source], NEED] + trip.best[NEED])
                for request, trip in zip(problem.requests, trips, strict=True)
            ]
            + [0] * (len(problem.drones) + 1)
        )
    return [*rows, [0] * len(rows[0])]
