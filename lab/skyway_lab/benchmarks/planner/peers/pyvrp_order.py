"""PyVRP's iterated local search, until 200 iterations brought nothing better."""

import numpy as np
import numpy.typing as npt
from pyvrp import Model
from pyvrp.stop import NoImprovement

_ITERATIONS = 200
_SEED = 1


class PyVrpOrder:
    """A travelling salesman whose way home is free."""

    package = "pyvrp"

    def order(self, flight_ms: npt.NDArray[np.int64]) -> list[int]:
        """The clients of the one route."""
        model = Model()
        places = [model.add_location(0, 0) for _ in flight_ms]
        model.add_depot(places[0])
        for place in places[1:]:
            model.add_client(place)
        model.add_vehicle_type()
        for row, leaving in enumerate(flight_ms.tolist()):
            for column, time_ms in enumerate(leaving):
                if row != column:
                    model.add_edge(places[row], places[column], distance=time_ms if column else 0)
        result = model.solve(NoImprovement(_ITERATIONS), seed=_SEED, display=False)
        (route,) = result.best.routes()
        return [activity.idx + 1 for activity in route if activity.is_client()]
