"""Packages that need more than lift: only drones that may carry them are compared."""

from typing import Any

import pytest

from skyway.drone.model import DroneModel
from skyway.drone.models import PAPER_SCENARIO
from tests.provider_registry.candidates.test_selection import (
    make_drone,
    make_provider,
    make_query,
    select,
)


def _with(**abilities: Any) -> DroneModel:
    return DroneModel.model_validate(PAPER_SCENARIO.model_dump() | abilities)


COOLED = _with(model_id="cooled", carries=["COLD"])
TINY = _with(model_id="tiny", cargo_mm={"length": 100, "width": 100, "height": 100})
CARGO = {
    "cold": {"package_id": "cold", "mass_kg": 1.0, "handling": ["COLD"]},
    "long": {
        "package_id": "long",
        "mass_kg": 1.0,
        "size_mm": {"length": 900, "width": 50, "height": 50},
    },
}


@pytest.mark.parametrize(
    ("names", "chosen"),
    [
        (["cold"], ["cooled"]),
        (["long"], ["plain", "cooled"]),
        (["cold", "long"], ["cooled"]),
    ],
)
def test_only_drones_that_may_carry_the_packages_are_compared(
    names: list[str], chosen: list[str]
) -> None:
    models = {"plain": PAPER_SCENARIO, "cooled": COOLED, "tiny": TINY}
    drones = [
        make_drone(name, model=model, away_deg=0.01 * number)
        for number, (name, model) in enumerate(models.items())
    ]
    query = make_query(packages=[CARGO[name] for name in names])

    found = select(query, providers=[make_provider("p")], drones=drones)

    assert list(found.shortlist.drone_ids) == chosen


def test_a_provider_that_would_split_sends_drones_that_carry_any_package() -> None:
    cold_and_tiny = _with(model_id="small", carries=["COLD"], cargo_mm=TINY.cargo_mm)
    drones = [make_drone("plain"), make_drone("small", model=cold_and_tiny, away_deg=0.1)]

    found = select(
        make_query(packages=list(CARGO.values())), providers=[make_provider("p")], drones=drones
    )

    assert sorted(found.shortlist.drone_ids) == ["plain", "small"]


@pytest.mark.parametrize(("name", "code"), [("cold", "HANDLING"), ("long", "TOO_LARGE")])
def test_a_provider_whose_drones_may_not_carry_a_package_says_why(name: str, code: str) -> None:
    found = select(
        make_query(packages=[CARGO[name]]),
        providers=[make_provider("p")],
        drones=[make_drone("tiny", model=TINY)],
    )

    (reason,) = found.infeasible
    assert (reason.code, reason.is_temporary) == (code, False)
    assert repr(name) in reason.detail
