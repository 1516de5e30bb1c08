"""Draws the picture of docs/dispatch.md: what each drone does in the arrival order and in the plan.

pip install '.[planner]' matplotlib
python docs/dispatch_picture.py          # writes docs/pictures/dispatch.png
"""

import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl

from skyway.dispatch import FleetPlan, FleetProblem, optimise, read_fleet_problem

mpl.use("Agg")
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.patches import Patch

HERE = Path(__file__).parent

COLOURS = {
    "FLY": "#3567b0",
    "RECHARGE": "#e0a030",
    "WAIT": "#c8c8c8",
    "PICK_UP": "#4c9f70",
    "DELIVER": "#b03a5b",
}


def example() -> FleetProblem:
    """The worked example of the page."""
    page = (HERE / "dispatch.md").read_text(encoding="utf-8")
    block = re.search(r"```json\n(.*?)```", page, re.DOTALL)
    assert block is not None
    return read_fleet_problem(json.loads(block[1]))


def draw(axes: Axes, title: str, plan: FleetPlan, drones: Sequence[str]) -> None:
    """One row for each drone; the requests of a trip are named where it begins."""
    for trip in plan.trips:
        row = drones.index(trip.drone_id)
        for step in trip.plan.steps:
            begins_min = (trip.start_s + step.start_s) / 60
            width_min = max(0.4, (step.end_s - step.start_s) / 60)
            axes.barh(row, width_min, left=begins_min, height=0.5, color=COLOURS[step.kind])
        names = ", ".join(each.request_id for each in trip.requests)
        axes.text(trip.start_s / 60, row - 0.33, names, fontsize=8)
    mean_min = (plan.costs.mean_delivery_s or 0.0) / 60
    axes.set_title(f"{title}: mean {mean_min:.0f} min, late {plan.costs.lateness_s / 60:.0f} min")
    axes.set_yticks(range(len(drones)), drones)
    axes.set_ylim(len(drones) - 0.5, -0.6)


def main(folder: Path) -> FleetPlan:
    """Plan the example, and write the picture."""
    problem = example()
    first, plan = optimise(problem, rounds=0), optimise(problem, rounds=5)
    figure, (above, below) = pyplot.subplots(2, 1, figsize=(8, 4), sharex=True, layout="tight")
    drones = [each.drone_id for each in problem.drones]
    draw(above, "arrival order", first, drones)
    draw(below, "plan", plan, drones)
    below.set_xlabel("minutes from now")
    patches = [Patch(color=colour, label=kind) for kind, colour in COLOURS.items()]
    above.legend(handles=patches, fontsize=7, ncols=5, loc="upper right")
    figure.savefig(folder / "dispatch.png", dpi=110)
    pyplot.close(figure)
    return plan


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "pictures")
