"""The order of a fleet's trips by VROOM through pyvroom."""

import numpy as np
import vroom
from skyway_lab.benchmarks.dispatch.routing_task import RoutingTask, alone

from skyway.dispatch.schedule import Sequences

_EXPLORATION = 5


def ordered_by_vroom(task: RoutingTask, *, budget_s: float, seed: int) -> Sequences:
    """The best order of several runs with hard ends, at VROOM's highest level of exploration.

    VROOM decides by itself when it ends, and has no seed. It makes the sum of all needs small.
    """
    del budget_s, seed
    nodes = len(task.needs_s)
    needs_s = np.zeros((nodes, nodes), np.uint32)
    needs_s[:, : task.requests] = task.needs_s

    def order(end_s: int) -> Sequences | None:
        document = vroom.Input()
        document.set_durations_matrix("car", needs_s)
        for drone, begin_s in enumerate(task.begins_s):
            document.add_vehicle(
                vroom.Vehicle(drone, start=task.requests + drone, time_window=[begin_s, end_s])
            )
        document.add_job([vroom.Job(each, location=each) for each in range(task.requests)])
        solution = document.solve(exploration_level=_EXPLORATION, nb_threads=1)
        routes = solution.routes
        jobs = routes[routes.type == "job"]
        if len(jobs) < task.requests:
            return None
        return tuple(
            alone([int(each) for each in jobs.id[jobs.vehicle_id == drone]])
            for drone in range(task.drones)
        )

    return task.best_with_ends(order)
