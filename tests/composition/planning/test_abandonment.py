"""A search ends when its caller leaves, and its thread is free for the next search."""

import asyncio
import json
import threading
from typing import Any

import pytest
from skyway_composition.planning.solver_pool import SolverPool

from skyway.network.geojson import write_network
from skyway.network.synthetic import synthetic_city
from skyway.planner.problem import Problem

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

#: Far less than the searches below would take, or be allowed to.
SOON_S = 60.0

#: Of the pool behind the route.
INQUIRY_THREADS = 2


def endless(make: Any) -> dict[str, Any]:
    """A problem whose enumeration takes longer than any limit."""
    return {
        "network": write_network(synthetic_city(stations=60, seed=1)),
        "drone": {"model": make.candidate().model.model_dump(mode="json"), "soc": 1.0},
        "source": "s1",
        "packages": [{"package_id": "p", "mass_kg": 0.1, "destination": "s60"}],
        "strategy": "exhaustive",
    }


def easy(document: dict[str, Any]) -> dict[str, Any]:
    """The same problem with a short search, fast even before the planner is compiled."""
    return {**document, "strategy": "heuristic"}


def searches() -> int:
    """The number of threads that have begun to search."""
    return sum(thread.name.startswith("solver") for thread in threading.enumerate())


async def post_and_leave(composition: Any, body: bytes) -> None:
    """Send the request and hang up, with the messages that uvicorn sends to the app."""
    messages = [
        {"type": "http.request", "body": body, "more_body": False},
        {"type": "http.disconnect"},
    ]
    app = composition.client._transport.app

    async def receive() -> Any:
        if len(messages) == 1:
            while searches() < INQUIRY_THREADS:  # noqa: ASYNC110 - of other threads
                await asyncio.sleep(0.01)
        return messages.pop(0)

    async def send(_message: Any) -> None:
        pytest.fail("the caller has left, so no answer must be sent")

    headers = [
        (b"authorization", b"Bearer secret of gateway"),
        (b"skyway-caller", b"operator:op"),
        (b"content-type", b"application/json"),
    ]
    scope = {
        "type": "http",
        "method": "POST",
        "path": "/v1/compositions",
        "query_string": b"",
        "headers": headers,
        "http_version": "1.1",
    }
    await app(scope, receive, send)
    assert messages == []


async def test_a_customer_who_hangs_up_ends_the_search(composition: Any, make: Any) -> None:
    document = endless(make)

    async with asyncio.timeout(SOON_S):
        body = json.dumps(document).encode()
        await asyncio.gather(*(post_and_leave(composition, body) for _ in range(INQUIRY_THREADS)))
        answer = await composition("customer:c", "POST", "/v1/compositions", easy(document))

    assert answer.json()["status"] == "feasible"


async def test_a_cancelled_search_leaves_its_thread_to_the_next(
    composition: Any, make: Any
) -> None:
    problem = Problem.model_validate(endless(make))
    other = Problem.model_validate(easy(endless(make)))
    async with asyncio.timeout(SOON_S), SolverPool(threads=1, time_limit_s=600.0) as solver:
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(solver.compose(problem), 0.2)

        plan = await solver.compose(other)

    assert plan.status == "feasible"


async def test_other_calls_are_answered_during_a_search(composition: Any, make: Any) -> None:
    problem = Problem.model_validate(endless(make))
    search = asyncio.create_task(composition.parts.inquiries.compose(problem))

    async with asyncio.timeout(SOON_S):
        answers = [await composition(None, "GET", "/healthz") for _ in range(5)]

    assert not search.done()
    search.cancel()
    assert [each.status_code for each in answers] == [200] * 5
