"""The plans for the paper's scenario are those written down; a change of one is to be looked at."""

from pathlib import Path

import pytest

from skyway.drone.models import DRONE_MODELS
from skyway.ids import DroneModelId
from skyway.network.network import Network
from skyway.planner import compose
from tests.library.planner.oracles.grid import bracket
from tests.library.planner.oracles.judge import disagreements
from tests.library.planner.oracles.texas import as_text, texas_problem

_FOLDER = Path(__file__).parent / "texas"


@pytest.mark.parametrize("model_id", DRONE_MODELS)
def test_the_plan_equals_the_stored_one(model_id: DroneModelId) -> None:
    problem = texas_problem(model_id)

    text = as_text(model_id, problem, compose(problem))

    assert text == (_FOLDER / f"{model_id}.txt").read_text(encoding="utf-8")


def test_the_grid_finds_nothing_better() -> None:
    problem = texas_problem(DroneModelId("dji-matrice-300-rtk"))
    plan = compose(problem)
    # The corridor's segments keep clear of its zones, and the grid knows only boxes.
    network = problem.network
    open_sky = Network(network.stations, network.segments, (), network.settings)

    found = bracket(problem.model_copy(update={"network": open_sky}), tick_s=20.0, after_s=15_000.0)

    assert disagreements(problem, plan, found) == []
    assert found.late_s - found.early_s < 600
