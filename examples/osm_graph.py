"""A graph of OpenStreetMap's kind in, a plan out: `python examples/osm_graph.py`.

Programs that load OpenStreetMap give nodes `x` (longitude) and `y` (latitude), edges `length` in
metres, and often several edges between two nodes. A skyway network has `pos` and `length_m`.
"""

import networkx as nx

from skyway.drone.models import DRONE_MODELS
from skyway.network.network import Network
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


def skyway_of(graph: "nx.MultiDiGraph[int]") -> Network:
    """A skyway network over the streets: a station at each node, the shortest of parallel edges."""
    skyway: nx.DiGraph[str] = nx.DiGraph()
    for node, place in graph.nodes(data=True):
        skyway.add_node(str(node), pos=(place["x"], place["y"]), pads=1)
    for one, other, edge in sorted(graph.edges(data=True), key=lambda edge: -edge[2]["length"]):
        skyway.add_edge(str(one), str(other), length_m=edge["length"])
    return from_networkx(skyway)


def main() -> None:
    """Plan one package across the streets, and print its path."""
    model = DRONE_MODELS["dji-matrice-300-rtk"]
    package = PackageToDeliver(package_id="book", mass_kg=0.4, destination="3")
    problem = Problem(
        network=skyway_of(streets()),
        drone=DroneAtStart(model=model, soc=model.top_soc),
        source="1",
        packages=[package],
    )
    plan = compose(problem)
    print(plan.status, f"after {plan.delivery_time_s:.0f} s, over", len(plan.steps), "steps")


if __name__ == "__main__":
    main()
