"""The solver pool: bounded, and never searching for nobody."""

import asyncio
from typing import Any

import pytest
from skyway_composition.planning.solver_pool import SolverPool

from skyway.delivery.plan import PlanStatus
from skyway.network.geojson import read_network
from skyway.planner.problem import Problem
from skyway.runtime.errors import ServiceUnavailable


def make_problem(make: Any, **members: Any) -> Problem:
    return Problem.model_validate(
        {
            "network": read_network(make.network()),
            "drone": {"model": make.candidate().model, "soc": 1.0},
            "source": "a",
            "packages": [{"package_id": "p1", "mass_kg": 0.4, "destination": "c"}],
            **members,
        }
    )


async def test_plans_are_made_beside_the_event_loop(make: Any) -> None:
    async with SolverPool(threads=2, time_limit_s=5.0) as solver:
        plans = await asyncio.gather(*(solver.compose(make_problem(make)) for _ in range(4)))

    assert all(plan.is_flyable for plan in plans)


async def test_a_search_whose_time_is_up_says_unknown(make: Any) -> None:
    async with SolverPool(threads=1, time_limit_s=0.0) as solver:
        plan = await solver.compose(make_problem(make, strategy="exhaustive"))

    assert plan.status is PlanStatus.UNKNOWN


async def test_a_closed_pool_is_unavailable(make: Any) -> None:
    with pytest.raises(ServiceUnavailable):
        await SolverPool(threads=1, time_limit_s=5.0).compose(make_problem(make))
