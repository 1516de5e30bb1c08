"""A graph of OpenStreetMap's kind in, a plan out: `python examples/osm_graph.py`.

Programs that load OpenStreetMap give nodes `x` (longitude) and `y` (latitude), edges `length` in
metres, and often several edges between two nodes. `from_networkx` reads such a graph as it is; node
1 becomes station "1".
"""

import networkx as nx

from skyway.drone.models import DRONE_MODELS
from skyway.network.nx import from_networkx
from skyway.planner import compose
from skyway.planner.problem import DroneAtStart, PackageToDeliver, Problem


def streets() -> "nx.MultiDiGraph[int]":
    """Four crossings of San Marcos, with two ways between two of them."""
    graph: nx.MultiDiGraph[int] = nx.MultiDiGraph(crs="epsg:4326")
    places = [(-97.9414, 29.8833), (-97.9289, 29.8847), (-97.9270, 29.8750), (-97.9402, 29.8741)]
    for node, (x, y) in enumerate(places, start=1):
        graph.add_node(node, x=x, y=y)
    for one, other, length in [
        (1, 2, 1225),
        (1, 2, 1610),
        (2, 3, 1095),
        (3, 4, 1280),
        (4, 1, 1030),
    ]:
        graph.add_edge(one, other, length=length)
        graph.add_edge(other, one, length=length)
    return graph


def main() -> None:
    """Plan one package across the streets, and print its path."""
    model = DRONE_MODELS["dji-matrice-300-rtk"]
    package = PackageToDeliver(package_id="book", mass_kg=0.4, destination="3")
    problem = Problem(
        network=from_networkx(streets()),
        drone=DroneAtStart(model=model, soc=model.top_soc),
        source="1",
        packages=[package],
    )
    plan = compose(problem)
    print(plan.status, f"after {plan.delivery_time_s:.0f} s, over", len(plan.steps), "steps")


if __name__ == "__main__":
    main()
