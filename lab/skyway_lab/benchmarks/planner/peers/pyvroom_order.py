"""VROOM through pyvroom, at its highest level of exploration, on one thread."""

import numpy as np
import numpy.typing as npt
import vroom

_EXPLORATION = 5


class PyVroomOrder:
    """One vehicle that ends wherever its last job is."""

    package = "pyvroom"

    def order(self, flight_ms: npt.NDArray[np.int64]) -> list[int]:
        """The jobs of the one vehicle."""
        task = vroom.Input()
        task.set_durations_matrix("car", flight_ms.astype(np.uint32))
        task.add_vehicle(vroom.Vehicle(0, start=0))
        task.add_job([vroom.Job(number, location=number) for number in range(1, len(flight_ms))])
        routes = task.solve(exploration_level=_EXPLORATION, nb_threads=1).routes
        return [int(job) for job in routes.id[routes.type == "job"]]
