"""The solver pool limits its searches and ends a search when its caller leaves."""

import asyncio
import sys
import threading
from types import FrameType
from typing import Any

import pytest
from skyway_composition.planning.solver_pool import ReadingTurn, SolverPool

from skyway.delivery.plan import Plan, PlanStatus
from skyway.network.geojson import read_network
from skyway.network.synthetic import synthetic_city
from skyway.planner.airspace import Airspace
from skyway.planner.hierarchy import Hierarchy
from skyway.planner.problem import Problem
from skyway.runtime.errors import ServiceUnavailable
from tests.long_cases import sampled


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


async def test_a_search_that_runs_out_of_time_answers_unknown(make: Any) -> None:
    async with SolverPool(threads=1, time_limit_s=0.0) as solver:
        plan = await solver.compose(make_problem(make, strategy="exhaustive"))

    assert plan.status is PlanStatus.UNKNOWN


@pytest.fixture
def local(make: Any) -> dict[str, Any]:
    """The arguments, besides the problem, with which a pool composes on the event loop."""
    network = read_network(make.network())
    return {"airspace": Airspace.of(network), "hierarchy": Hierarchy.of(network)}


def without_times(plan: Plan) -> Plan:
    return plan.model_copy(update={"stats": {**plan.stats, "elapsed_s": 0.0}})


@pytest.mark.parametrize("labels", sampled([*range(1, 33), 2_048], every=8))
@pytest.mark.parametrize("members", [{}, {"latest_delivery_s": 10.0}])
async def test_a_plan_does_not_depend_on_the_limit_of_inline_labels(
    make: Any, local: Any, labels: int, members: Any
) -> None:
    problem = make_problem(make, **members)
    async with SolverPool(threads=1, time_limit_s=5.0) as beside:
        expected = await beside.compose(problem, **local)

    async with SolverPool(threads=1, time_limit_s=5.0, inline_labels=labels) as solver:
        await solver.warm()
        plan = await solver.compose(problem, **local)

    assert without_times(plan) == without_times(expected)


async def test_a_compiled_planner_is_loaded_when_a_drone_reports() -> None:
    async with SolverPool(threads=1, time_limit_s=5.0) as solver:
        await solver.warm()  # now it is on disk
    async with SolverPool(threads=1, time_limit_s=5.0) as solver, asyncio.timeout(60):
        warming = asyncio.create_task(solver.warm_when_needed())
        while not solver.is_compiled:  # noqa: ASYNC110 - a thread finds it on disk
            await asyncio.sleep(0)
        assert not solver.is_warm

        solver.needed.set()
        await warming

        assert solver.is_warm


async def test_a_small_problem_needs_no_thread(make: Any, local: Any) -> None:
    async with SolverPool(threads=1, time_limit_s=5.0, inline_labels=2_048) as solver:
        await solver.warm()
        composing = solver.compose(make_problem(make), **local)

        # It lets other tasks run once, and then has its plan.
        composing.send(None)
        with pytest.raises(StopIteration) as made:
            composing.send(None)

    assert made.value.value.is_flyable


async def test_other_tasks_run_between_many_small_problems(make: Any, local: Any) -> None:
    turns = 0

    async def others() -> None:
        nonlocal turns
        while True:
            turns += 1
            await asyncio.sleep(0)

    async with SolverPool(threads=1, time_limit_s=5.0, inline_labels=2_048) as solver:
        await solver.warm()
        running = asyncio.create_task(others())
        for _ in range(10):
            await solver.compose(make_problem(make), **local)
        running.cancel()

    assert turns >= 10


async def test_a_problem_with_many_labels_does_not_block_the_event_loop(make: Any) -> None:
    """No delivery is possible in 10 s. This is found soon, but its proof needs many labels."""
    network = synthetic_city(stations=400, seed=1)
    problem = make_problem(
        make,
        network=network,
        source="s1",
        packages=[{"package_id": "p1", "mass_kg": 0.4, "destination": "s400"}],
        latest_delivery_s=10.0,
    )
    calls = 0

    def note(_frame: FrameType, event: str, _of: object) -> None:
        nonlocal calls
        calls += event == "call"

    async with SolverPool(threads=1, time_limit_s=5.0, inline_labels=16) as solver:
        await solver.warm()
        composing = solver.compose(
            problem, airspace=Airspace.of(network), hierarchy=Hierarchy.of(network)
        )
        sys.setprofile(note)
        try:
            composing.send(None)
        finally:
            sys.setprofile(None)
        composing.close()

    # Visiting each station once takes longer than that.
    assert calls < 1_000


@pytest.mark.parametrize(
    "members",
    [
        {"strategy": "heuristic"},
        {"label_limit": 10},
        {
            "packages": [
                {"package_id": f"p{n}", "mass_kg": 0.1, "destination": "c"} for n in range(6)
            ]
        },
        {
            "closures": [
                {"station_id": "e", "start_s": float(n), "end_s": n + 0.5} for n in range(51)
            ]
        },
    ],
)
async def test_a_large_problem_goes_to_a_thread(make: Any, local: Any, members: Any) -> None:
    async with SolverPool(threads=1, time_limit_s=5.0, inline_labels=2_048) as solver:
        await solver.warm()
        composing = asyncio.ensure_future(solver.compose(make_problem(make, **members), **local))

        await asyncio.sleep(0)

        assert not composing.done()
        await composing


async def test_a_closed_pool_is_unavailable(make: Any) -> None:
    with pytest.raises(ServiceUnavailable):
        await SolverPool(threads=1, time_limit_s=5.0).compose(make_problem(make))


async def test_a_caller_that_leaves_while_it_waits_is_never_read() -> None:
    turn, may_end, begun = ReadingTurn(), threading.Event(), list[str]()

    def read(name: str) -> str:
        begun.append(name)
        may_end.wait(60)
        return name

    first = asyncio.create_task(turn.run(read, "first"))
    others = [asyncio.create_task(turn.run(read, f"other {n}")) for n in range(40)]
    while not begun:  # noqa: ASYNC110 - of a thread
        await asyncio.sleep(0)
    for each in (first, *others):
        each.cancel()
    await asyncio.sleep(0)
    may_end.set()
    last = await turn.run(read, "last")

    assert last == "last"
    assert begun == ["first", "last"]
    with pytest.raises(asyncio.CancelledError):
        await first


async def test_an_error_of_the_reader_is_raised() -> None:
    with pytest.raises(ValueError, match="invalid literal"):
        await ReadingTurn().run(int, "x")
