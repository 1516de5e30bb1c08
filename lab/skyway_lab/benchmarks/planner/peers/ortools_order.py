"""OR-Tools' routing library, as its guide has it: cheapest arc first, then local search."""

import numpy as np
import numpy.typing as npt
from ortools.constraint_solver import pywrapcp, routing_enums_pb2


class OrToolsOrder:
    """A travelling salesman whose way home is free."""

    package = "ortools"

    def order(self, flight_ms: npt.NDArray[np.int64]) -> list[int]:
        """The stops of the one vehicle."""
        open_ended = flight_ms.copy()
        open_ended[:, 0] = 0
        manager = pywrapcp.RoutingIndexManager(len(open_ended), 1, 0)
        routing = pywrapcp.RoutingModel(manager)
        transit = routing.RegisterTransitMatrix(open_ended.tolist())
        routing.SetArcCostEvaluatorOfAllVehicles(transit)
        parameters = pywrapcp.DefaultRoutingSearchParameters()
        parameters.first_solution_strategy = (
            routing_enums_pb2.FirstSolutionStrategy.PATH_CHEAPEST_ARC
        )
        solution = routing.SolveWithParameters(parameters)
        order = []
        index = solution.Value(routing.NextVar(routing.Start(0)))
        while not routing.IsEnd(index):
            order.append(manager.IndexToNode(index))
            index = solution.Value(routing.NextVar(index))
        return order
