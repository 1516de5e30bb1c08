"""frvcpy: the labelling of Froger et al. for electric vehicles on a fixed route."""

from typing import Any

from frvcpy.solver import Solver
from skyway_lab.benchmarks.planner.peers.interface import ChargingTask


class FrvcpyCharging:
    """The best detours to stations and amounts charged, between stops in a given order."""

    package = "frvcpy"

    def delivery_time_s(self, task: ChargingTask) -> float:
        """The duration of its best route."""
        solver = Solver(_instance(task), list(task.stops), task.capacity_j)
        duration_s, _ = solver.solve()
        return float(duration_s)


def _instance(task: ChargingTask) -> dict[str, Any]:  # frvcpy's own JSON form
    curve = {"cs_type": 0, "time": list(task.curve_s), "charge": list(task.curve_j)}
    return {
        "max_q": task.capacity_j,
        "css": [{"node_id": station, "cs_type": 0} for station in task.stations],
        "time_matrix": task.seconds,
        "energy_matrix": task.joules,
        "breakpoints_by_type": [curve],
    }
