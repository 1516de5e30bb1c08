"""The paper's scenario as text: San Marcos to McQueeney, Bulverde and San Antonio in Texas.

``python -m oracles.texas FOLDER``, from tests/library/planner, writes a file for each drone model;
`exact/texas` holds the expected ones.
"""

import sys
from datetime import timedelta
from pathlib import Path

from skyway.delivery.plan import Deliver, Fly, PickUp, Plan, Recharge, Step, Wait
from skyway.drone.models import DRONE_MODELS
from skyway.ids import DroneModelId
from skyway.network.bundled import texas_corridor
from skyway.network.network import Network
from skyway.planner.compose import compose
from skyway.planner.problem import Problem
from skyway.units import TIME_TOLERANCE_S

_SOURCE = "san-marcos"
_DESTINATIONS = ("mcqueeney", "bulverde", "san-antonio")

#: Kilograms of each package; together less than the smallest payload of the three models.
_MASS_KG = 0.7


def texas_problem(model_id: DroneModelId) -> Problem:
    """A package for each of the three towns, the drone full, all pads free."""
    return Problem.model_validate(
        {
            "network": texas_corridor(),
            "drone": {"model": DRONE_MODELS[model_id], "soc": 1.0},
            "source": _SOURCE,
            "packages": [
                {"package_id": f"for-{name}", "mass_kg": _MASS_KG, "destination": name}
                for name in _DESTINATIONS
            ],
        }
    )


def as_text(model_id: DroneModelId, problem: Problem, plan: Plan) -> str:
    """The plan's steps, a line each, times rounded to the second and charges to the percent.

    Waits and recharges that take no time are left out: they only show that the drone lands.
    """
    delivered = "never" if plan.delivery_time_s is None else _clock(plan.delivery_time_s)
    lines = [f"{model_id}: {plan.status}, delivered after {delivered}"]
    lines += [_line(problem.network, step) for step in plan.steps if not _is_nothing(step)]
    return "\n".join(lines) + "\n"


def _is_nothing(step: Step) -> bool:
    return isinstance(step, Wait | Recharge) and step.end_s - step.start_s < TIME_TOLERANCE_S


def _line(network: Network, step: Step) -> str:
    def name(station_id: str) -> str | None:
        return next(one.name for key, one in network.stations.items() if key == station_id)

    span = f"{_clock(step.start_s)} to {_clock(step.end_s)}  {step.kind:<8}  "
    if isinstance(step, Fly):
        ends = f"{name(step.from_id)} to {name(step.to_id)}"
        return f"{span}{ends}, {step.load_kg:.1f} kg, {step.soc_end:.0%} left"
    if isinstance(step, Recharge):
        return f"{span}{name(step.station_id)}, {step.soc_start:.0%} to {step.soc_end:.0%}"
    if isinstance(step, PickUp | Deliver):
        return f"{span}{name(step.station_id)}, {', '.join(step.package_ids)}"
    return f"{span}{name(step.station_id)}"


def _clock(at_s: float) -> str:
    return str(timedelta(seconds=round(at_s)))


def _main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for model_id in DRONE_MODELS:
        problem = texas_problem(model_id)
        text = as_text(model_id, problem, compose(problem))
        (folder / f"{model_id}.txt").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    _main(Path(sys.argv[1]))
