"""Skyway as a library: a NetworkX graph in, a plan out, drawn. No service runs.

    pip install '.[planner]' matplotlib
    python docs/texas_corridor.py            # writes texas_corridor.png

The scenario is the paper's: three packages from San Marcos to McQueeney, Bulverde and San Antonio.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
import networkx as nx

from skyway.delivery.plan import Fly, Plan, Recharge
from skyway.drone.charging import soc_after_recharge
from skyway.drone.model import DroneModel
from skyway.drone.models import DRONE_MODELS
from skyway.network.bundled import texas_corridor
from skyway.network.nx import from_networkx, to_networkx
from skyway.planner import compose
from skyway.planner.problem import DroneAtStart, PackageToDeliver, Problem

mpl.use("Agg")
from matplotlib import pyplot
from matplotlib.axes import Axes

MODEL = DRONE_MODELS["dji-matrice-300-rtk"]


def corridor() -> nx.Graph:
    """Any graph will do whose nodes have `pos` (longitude, latitude): here the bundled places."""
    return nx.Graph(to_networkx(texas_corridor()))


def scenario(graph: nx.Graph) -> Problem:
    """Three packages of half a kilogram each, a full battery, one pad of Seguin taken all day."""
    destinations = ("mcqueeney", "bulverde", "san-antonio")
    return Problem(
        network=from_networkx(graph),
        drone=DroneAtStart(model=MODEL, soc=MODEL.top_soc),
        source="san-marcos",
        packages=[
            PackageToDeliver(package_id=f"p{n}", mass_kg=0.5, destination=destination)
            for n, destination in enumerate(destinations, start=1)
        ],
        pad_reservations=[{"station_id": "seguin", "pad": 0, "start_s": 0.0, "end_s": 86_400.0}],
    )


def show(plan: Plan) -> Iterator[str]:
    """The plan in lines."""
    yield f"{plan.status}: delivered after {plan.delivery_time_s / 3600:.2f} h"
    for step in plan.steps:
        where = f"{step.from_id} to {step.to_id}" if isinstance(step, Fly) else step.station_id
        soc = f"{step.soc_end:.0%}" if isinstance(step, Fly | Recharge) else ""
        yield f"{step.start_s / 60:7.1f} min  {step.kind:9} {where:32} {soc:>5}"


def battery(model: DroneModel, plan: Plan, soc: float) -> tuple[list[float], list[float]]:
    """Minutes and charges: straight while flying, along the charge curve on a pad."""
    minutes, socs = [0.0], [soc]
    for step in plan.steps:
        points = [(step.end_s, getattr(step, "soc_end", socs[-1]))]
        if isinstance(step, Recharge):
            parts = [(step.end_s - step.start_s) * part / 20 for part in range(1, 21)]
            points = [
                (step.start_s + part, soc_after_recharge(model, step.soc_start, part))
                for part in parts
            ]
        for at_s, charge in points:
            minutes.append(at_s / 60)
            socs.append(charge)
    return minutes, socs


def draw_plan(axes: Axes, graph: nx.Graph, plan: Plan) -> None:
    """The network in grey, the flight in colour, recharges as rings."""
    positions = nx.get_node_attributes(graph, "pos")
    nx.draw_networkx_edges(graph, positions, ax=axes, edge_color="#dddddd", width=0.6)
    nx.draw_networkx_nodes(graph, positions, ax=axes, node_color="#bbbbbb", node_size=8)
    flown = [(step.from_id, step.to_id) for step in plan.steps if isinstance(step, Fly)]
    path = nx.DiGraph(flown)
    nx.draw_networkx_edges(path, positions, ax=axes, edge_color="#0072B2", width=1.8, node_size=8)
    pads = [step.station_id for step in plan.steps if isinstance(step, Recharge)]
    nx.draw_networkx_nodes(
        graph, positions, pads, ax=axes, node_size=60, node_color="none", edgecolors="#D55E00"
    )
    ends = {flown[0][0], *(delivery.station_id for delivery in plan.deliveries)}
    names = {station: graph.nodes[station].get("name", station) for station in ends}
    nx.draw_networkx_labels(
        graph, positions, names, ax=axes, font_size=8, verticalalignment="bottom"
    )
    axes.set_title("The plan (rings: recharging)", fontsize=10)


def draw_battery(axes: Axes, problem: Problem, plan: Plan) -> None:
    """The charge over time, with the reserve and the deliveries."""
    model = problem.drone.model
    axes.plot(*battery(model, plan, problem.drone.soc), color="#0072B2")
    axes.axhline(model.reserve_soc, color="#D55E00", linestyle="--", label="reserve")
    for delivery in plan.deliveries:
        axes.axvline(delivery.delivered_s / 60, color="#999999", linewidth=0.8)
    axes.set(xlabel="minutes", ylabel="state of charge", ylim=(0, 1))
    axes.set_title("The battery (lines: deliveries)", fontsize=10)
    axes.legend()


def main(folder: Path) -> Plan:
    """Compose, print and draw."""
    graph = corridor()
    problem = scenario(graph)
    plan = compose(problem)
    print("\n".join(show(plan)))  # noqa: T201 - the script is run by hand
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    draw_plan(left, graph, plan)
    draw_battery(right, problem, plan)
    figure.savefig(folder / "texas_corridor.png", dpi=110)
    pyplot.close(figure)
    return plan


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path())
