"""Compiles the dispatcher, or loads it from disk, before it is needed.

``python -m skyway.dispatch.warm`` leaves the compiled dispatcher on disk.
"""

from skyway.dispatch.optimise import optimise
from skyway.dispatch.problem import FleetProblem
from skyway.planner.warm import MODEL, STATIONS, line_network


def warm() -> None:
    """Plan fleets that use every part of the dispatcher; the first time takes long."""
    for drones in (1, 5):  # large fleets have another bound
        _plan_fleet(drones)


def _plan_fleet(drones: int) -> None:
    first, middle, last = STATIONS
    request = {"source": first, "pooling": True}
    optimise(
        FleetProblem.model_validate(
            {
                "network": line_network(),
                "drones": [
                    {"drone_id": f"d{each}", "model": MODEL, "station_id": middle, "soc": 1.0}
                    for each in range(drones)
                ],
                "requests": [
                    {
                        **request,
                        "request_id": end,
                        "packages": [{"package_id": end, "mass_kg": 0.3, "destination": end}],
                    }
                    for end in (middle, last)
                ],
                "loading_s": 60.0,
            }
        ),
        rounds=1,
        proves=True,
    )


if __name__ == "__main__":
    warm()
