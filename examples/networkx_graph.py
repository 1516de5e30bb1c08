"""A NetworkX graph in, a plan out: `python examples/networkx_graph.py`.

Nodes have `pos` (longitude, latitude); edges may have `length_m`, else a segment is as long as the
great circle between its stations.
"""

import networkx as nx

from skyway.drone.models import DRONE_MODELS
from skyway.network.nx import from_networkx
from skyway.planner import compose
from skyway.planner.problem import DroneAtStart, PackageToDeliver, Problem


def main() -> None:
    """Plan two packages over three roofs, and print the steps."""
    graph = nx.Graph()
    graph.add_node("depot", pos=(-98.0, 29.6), pads=2)
    graph.add_node("ridge", pos=(-98.1, 29.6), pads=1)
    graph.add_node("clinic", pos=(-98.2, 29.6))
    graph.add_edge("depot", "ridge")
    graph.add_edge("ridge", "clinic", length_m=9_800)

    model = DRONE_MODELS["dji-matrice-300-rtk"]
    problem = Problem(
        network=from_networkx(graph),
        drone=DroneAtStart(model=model, soc=0.6),
        source="depot",
        packages=[
            PackageToDeliver(package_id="medicine", mass_kg=1.2, destination="clinic"),
            PackageToDeliver(package_id="tools", mass_kg=0.5, destination="ridge"),
        ],
    )
    plan = compose(problem)
    print(plan.status, f"after {plan.delivery_time_s:.0f} s")
    for step in plan.steps:
        print(f"{step.start_s:7.0f} s  {step.kind}")


if __name__ == "__main__":
    main()
