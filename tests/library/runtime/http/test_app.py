"""The answers that all services share, over real HTTP semantics (httpx's ASGI transport)."""

import json
import re
from collections.abc import Callable

import httpx
import pytest
from fastapi import FastAPI
from starlette.routing import Route


async def no_database() -> dict[str, bool]:
    return {"database": False, "mqtt": False}


async def no_broker() -> dict[str, bool]:
    return {"database": True, "mqtt": False}


async def test_a_process_is_alive_and_ready(client: httpx.AsyncClient) -> None:
    assert (await client.get("/healthz")).json() == {"service": "loads", "checks": {}}
    assert (await client.get("/readyz")).json() == {
        "service": "loads",
        "checks": {"database": True},
    }


async def test_readiness_names_the_missing_parts(
    assert_is_problem: Callable[..., None], make_app: Callable[..., FastAPI]
) -> None:
    transport = httpx.ASGITransport(make_app(no_database))
    async with httpx.AsyncClient(transport=transport, base_url="http://loads") as client:
        answer = await client.get("/readyz")

    assert_is_problem(answer, 503, "service-unavailable")
    assert "missing: database, mqtt" in answer.json()["detail"]


async def test_a_service_without_its_broker_is_ready_for_requests(
    make_app: Callable[..., FastAPI],
) -> None:
    transport = httpx.ASGITransport(make_app(no_broker))
    async with httpx.AsyncClient(transport=transport, base_url="http://loads") as client:
        answer = await client.get("/readyz")

    assert (answer.status_code, answer.json()["checks"]) == (200, await no_broker())


def test_each_route_is_matched_once(
    make_app: Callable[..., FastAPI],
) -> None:
    assert all(isinstance(route, Route) for route in make_app().routes)


@pytest.mark.parametrize("path", ["/healthz", "/loads", "/nowhere", "/openapi.json"])
async def test_nobody_keeps_an_answer_or_guesses_its_type(
    client: httpx.AsyncClient, path: str
) -> None:
    answer = await client.get(path)

    assert answer.headers["cache-control"] == "no-store"
    assert answer.headers["x-content-type-options"] == "nosniff"


async def test_the_docs_page_asks_no_other_host(
    client: httpx.AsyncClient, assert_is_problem: Callable[..., None]
) -> None:
    page = await client.get("/docs")
    links = re.findall(r'(?:src|href)="([^"]+)"', page.text)

    assert len(links) == 4
    assert "unsafe-inline" not in page.headers["content-security-policy"]
    assert "://" not in page.text
    for link in links:
        assert (await client.get(link)).status_code == 200
    assert_is_problem(await client.get("/docs/assets/other"), 404, "not-found")


async def test_openapi_documents_problems_and_internal_bodies(client: httpx.AsyncClient) -> None:
    document = (await client.get("/openapi.json")).json()

    assert document["openapi"].startswith("3.1")
    responses = document["paths"]["/loads"]["post"]["responses"]
    assert {"200", "400", "413", "415", "422", "default"} <= set(responses)
    assert responses["400"] == {"$ref": "#/components/responses/BrokenJson"}
    shared = document["components"]["responses"]
    assert list(shared["BrokenJson"]["content"]) == ["application/problem+json"]
    body = document["paths"]["/internal/orders"]["put"]["requestBody"]
    assert body["content"]["application/json"]["schema"]["$ref"].endswith("/Order")
    assert {"Order", "Load", "ProblemDetails", "FieldProblem"} <= set(
        document["components"]["schemas"]
    )
    assert "HTTPValidationError" not in json.dumps(document)
