"""Sizes, paths and traces are checked before a route is reached."""

import re
from collections.abc import AsyncIterator, Callable

import httpx
from starlette.requests import Request

from skyway.runtime.http.request_boundary import _logged_path

TRACE_ID = "4bf92f3577b34da6a3ce929d0e0e4736"


async def test_a_nul_in_the_path_or_query_is_refused(
    client: httpx.AsyncClient, assert_is_problem: Callable[..., None]
) -> None:
    for path in ("/errors/a%00b", "/loads?limit=%00"):
        answer = await client.get(path)

        assert_is_problem(answer, 400, "bad-request")


async def test_a_body_above_the_limit_is_refused_with_the_limit(
    client: httpx.AsyncClient, assert_is_problem: Callable[..., None]
) -> None:
    answer = await client.post("/loads", content=b" " * 262_145)

    assert_is_problem(answer, 413, "too-large")
    assert "262144" in answer.json()["detail"]


async def test_a_chunked_body_above_the_limit_is_refused(
    client: httpx.AsyncClient, assert_is_problem: Callable[..., None]
) -> None:
    async def chunks() -> AsyncIterator[bytes]:
        for _ in range(5):
            yield b" " * 65_536

    headers = {"content-type": "application/json"}

    answer = await client.post("/loads", content=chunks(), headers=headers)

    assert_is_problem(answer, 413, "too-large")


async def test_a_route_may_take_larger_bodies(
    client: httpx.AsyncClient, assert_is_problem: Callable[..., None]
) -> None:
    within = await client.put("/big/one", content=b" " * 1_000_000)
    beyond = await client.put("/big/one", content=b" " * 1_000_001)

    assert within.json() == 1_000_000
    assert_is_problem(beyond, 413, "too-large")


async def test_a_trace_goes_on_under_a_span_of_our_own(client: httpx.AsyncClient) -> None:
    received = f"00-{TRACE_ID}-00f067aa0ba902b7-00"

    answer = await client.get("/trace", headers={"traceparent": received})

    assert re.fullmatch(f"00-{TRACE_ID}-[0-9a-f]{{16}}-00", answer.json())
    assert answer.json() != received


async def test_a_trace_begins_where_none_came_or_a_broken_one(client: httpx.AsyncClient) -> None:
    for headers in ({}, {"traceparent": "00-nonsense"}, {"traceparent": f"00-{'0' * 32}-x-01"}):
        answer = await client.get("/trace", headers=headers)

        assert re.fullmatch("00-[0-9a-f]{32}-[0-9a-f]{16}-01", answer.json())


def test_of_a_path_without_a_route_only_the_beginning_is_logged() -> None:
    """A mistyped link may still hold its secret."""
    request = Request({"type": "http", "path": "/track/del_1/secret/statee", "path_params": {}})

    assert _logged_path(request) == "/track/..."
