"""What every service answers alike, over real HTTP semantics (httpx's ASGI transport)."""

import json
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Annotated, Any

import httpx
import pytest
from fastapi import APIRouter, Depends, FastAPI, Request
from pydantic import Field

from skyway.errors import InvalidInput
from skyway.json_model import JsonModel
from skyway.runtime.errors import (
    AccessDenied,
    Conflict,
    IdempotencyKeyReused,
    MqttUnavailable,
    NotFound,
    PreconditionFailed,
    RemoteProblem,
    ServiceUnavailable,
    Taken,
    TooLarge,
    Unauthenticated,
)
from skyway.runtime.http_app import body_limits, create_app, internal_body, read_json
from skyway.runtime.tracing import current_traceparent

TRACE_ID = "4bf92f3577b34da6a3ce929d0e0e4736"


class Crate(JsonModel):
    mass_kg: Annotated[float, Field(ge=0)]


class Load(JsonModel):
    crates: tuple[Crate, ...] = ()
    price: int = 0
    notes: dict[str, Any] = Field(default_factory=dict)


class Order(JsonModel):
    order_id: str
    load: Load = Load()


router = APIRouter()


@router.get("/loads")
async def list_loads(limit: Annotated[int, Field(ge=1, le=200)] = 50) -> dict[str, int]:
    return {"limit": limit}


@router.post("/loads")
async def add_load(load: Load) -> Load:
    return load


@router.delete("/loads")
async def drop_loads() -> None:
    """Nothing to drop."""


@router.post("/mixed")
async def add_one_or_many(loads: Load | list[Load]) -> int:
    return 1 if isinstance(loads, Load) else len(loads)


@router.put("/big/{name}")
async def put_big(name: str, request: Request) -> int:
    return len(await request.body())


@router.put("/raw")
async def put_raw(request: Request) -> Any:
    return read_json(await request.body())


@router.put("/internal/orders")
async def put_order(order: Annotated[Order, Depends(internal_body(Order))]) -> str:
    return order.order_id


@router.get("/trace")
async def show_trace() -> str | None:
    return current_traceparent()


ERRORS: dict[str, Exception] = {
    "bug": ZeroDivisionError("the inside"),
    "invalid": InvalidInput("packages.0.mass_kg", "17.2 exceeds 15.3"),
    "unauthenticated": Unauthenticated(),
    "denied": AccessDenied("only operators"),
    "missing": NotFound("delivery", "d1"),
    "conflict": Conflict("TOO_LATE", "it has left"),
    "taken": Taken("one_mission_per_drone"),
    "changed": PreconditionFailed(expected="1", present="2"),
    "large": TooLarge(7),
    "reused": IdempotencyKeyReused(),
    "away": ServiceUnavailable("composition", "no answer"),
    "broker": MqttUnavailable("not connected"),
    "remote": RemoteProblem(409, {"type": "urn:x", "title": "No", "status": 409, "why": 7}),
}


@router.get("/errors/{name}")
async def fail(name: str) -> None:
    raise ERRORS[name]


async def everything_there() -> dict[str, bool]:
    return {"database": True}


async def no_broker() -> dict[str, bool]:
    return {"database": True, "broker": False}


@asynccontextmanager
async def nothing_to_open(_app: FastAPI) -> AsyncIterator[None]:
    yield


def make_app(readiness: Any = everything_there) -> FastAPI:
    return create_app(
        service="loads",
        title="Loads",
        description="For tests.",
        routers=[router],
        lifespan=nothing_to_open,
        readiness=readiness,
        body_limit=body_limits({"PUT /big/{name}": 1_000_000}),
    )


@pytest.fixture
async def client() -> AsyncIterator[httpx.AsyncClient]:
    transport = httpx.ASGITransport(make_app())
    async with httpx.AsyncClient(transport=transport, base_url="http://loads") as opened:
        yield opened


def fields_at_fault(answer: httpx.Response) -> list[str]:
    return [problem["field"] for problem in answer.json()["errors"]]


def assert_is_problem(answer: httpx.Response, status: int, name: str) -> None:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["type"] == f"urn:skyway:problem:{name}"
    assert answer.json()["status"] == status


@pytest.mark.parametrize(
    ("name", "status", "kind"),
    [
        ("invalid", 422, "invalid-input"),
        ("unauthenticated", 401, "unauthenticated"),
        ("denied", 403, "access-denied"),
        ("missing", 404, "not-found"),
        ("conflict", 409, "conflict"),
        ("taken", 409, "taken"),
        ("changed", 412, "precondition-failed"),
        ("large", 413, "too-large"),
        ("reused", 422, "idempotency-key-reused"),
        ("away", 503, "service-unavailable"),
        ("broker", 503, "service-unavailable"),
    ],
)
async def test_each_error_has_its_problem(
    client: httpx.AsyncClient, name: str, status: int, kind: str
) -> None:
    answer = await client.get(f"/errors/{name}")

    assert_is_problem(answer, status, kind)


async def test_a_remote_problem_passes_unchanged(client: httpx.AsyncClient) -> None:
    answer = await client.get("/errors/remote")

    assert answer.status_code == 409
    assert answer.json() == {"type": "urn:x", "title": "No", "status": 409, "why": 7}


async def test_a_bug_is_a_500_that_shows_nothing_of_the_inside(
    client: httpx.AsyncClient, caplog: pytest.LogCaptureFixture
) -> None:
    headers = {"traceparent": f"00-{TRACE_ID}-00f067aa0ba902b7-01"}

    answer = await client.get("/errors/bug", headers=headers)

    assert_is_problem(answer, 500, "internal-error")
    assert "inside" not in answer.text
    assert answer.json()["trace_id"] == TRACE_ID
    assert "request failed" in caplog.text


async def test_a_conflict_names_its_code(client: httpx.AsyncClient) -> None:
    answer = await client.get("/errors/conflict")

    assert answer.json()["code"] == "TOO_LATE"
    assert answer.json()["detail"] == "it has left"


async def test_an_unauthenticated_caller_is_asked_for_a_bearer(client: httpx.AsyncClient) -> None:
    answer = await client.get("/errors/unauthenticated")

    assert answer.headers["www-authenticate"] == "Bearer"


async def test_every_field_at_fault_is_named(client: httpx.AsyncClient) -> None:
    body = {"crates": [{"mass_kg": 1}, {"mass_kg": -1}, {}], "colour": "red"}

    answer = await client.post("/loads", json=body)

    assert_is_problem(answer, 422, "invalid-input")
    assert sorted(fields_at_fault(answer)) == ["colour", "crates.1.mass_kg", "crates.2.mass_kg"]
    assert "greater than or equal to 0" in answer.text


async def test_a_query_parameter_at_fault_is_named_by_itself(client: httpx.AsyncClient) -> None:
    answer = await client.get("/loads", params={"limit": 201})

    assert fields_at_fault(answer) == ["limit"]


async def test_the_arms_of_a_union_are_not_named_as_fields(client: httpx.AsyncClient) -> None:
    answer = await client.post("/mixed", json=[{"price": "much"}])

    assert "0.price" in fields_at_fault(answer)
    assert not [field for field in fields_at_fault(answer) if "list" in field or "Load" in field]


@pytest.mark.parametrize(
    ("raw", "status", "name"),
    [
        (b'{"price": ', 400, "broken-json"),
        (b"\xff\xfe{", 400, "broken-json"),
        ('{"price": 1}'.encode("utf-16"), 400, "broken-json"),
        (b'{"notes": {"a": "\xed\xa0\x80"}}', 400, "broken-json"),
        (b'{"price": ' + b"9" * 5000 + b"}", 400, "broken-json"),
        (b"[" * 100_000, 400, "broken-json"),
        (b'"text"', 422, "invalid-input"),
        (b"", 422, "invalid-input"),
        (b"null", 422, "invalid-input"),
    ],
)
async def test_what_is_no_body_of_ours_is_refused(
    client: httpx.AsyncClient, raw: bytes, status: int, name: str
) -> None:
    headers = {"content-type": "application/json"}

    answer = await client.post("/loads", content=raw, headers=headers)

    assert_is_problem(answer, status, name)


@pytest.mark.parametrize(
    ("raw", "field"),
    [
        (b'{"crates": [{"mass_kg": NaN}]}', "crates.0.mass_kg"),
        (b'{"notes": {"a": [1, -Infinity]}}', "notes.a.1"),
        (b'{"notes": {"a": 1e999}}', "notes.a"),
        (b'{"price": 9223372036854775808}', "price"),
        (b'{"notes": {"a": "\\u0000"}}', "notes.a"),
        (b'{"notes": {"a": "\\ud800"}}', "notes.a"),
        (b'{"notes": {"\\u0000": 1}}', "notes"),
        (b'{"notes": ' + b'{"a":' * 200 + b"1" + b"}" * 201, "body"),
    ],
)
async def test_what_no_database_holds_is_refused_with_its_field(
    client: httpx.AsyncClient, raw: bytes, field: str
) -> None:
    headers = {"content-type": "application/json"}

    answer = await client.post("/loads", content=raw, headers=headers)

    assert_is_problem(answer, 422, "invalid-input")
    assert fields_at_fault(answer) == [field]


async def test_a_field_name_that_is_no_text_is_still_answered(client: httpx.AsyncClient) -> None:
    headers = {"content-type": "application/json"}

    answer = await client.post("/loads", content=b'{"\\ud800": 1}', headers=headers)

    assert_is_problem(answer, 422, "invalid-input")


async def test_emoji_in_escapes_pass(client: httpx.AsyncClient) -> None:
    headers = {"content-type": "application/json"}

    answer = await client.post(
        "/loads", content=b'{"notes": {"a": "\\ud83d\\ude80"}}', headers=headers
    )

    assert answer.json()["notes"] == {"a": "\N{ROCKET}"}


@pytest.mark.parametrize("kind", ["application/x-www-form-urlencoded", "text/plain", ""])
async def test_a_body_of_another_type_is_refused(client: httpx.AsyncClient, kind: str) -> None:
    headers = {"content-type": kind} if kind else {}

    answer = await client.post("/loads", content=b'{"price": 1}', headers=headers)

    assert_is_problem(answer, 415, "unsupported-media-type")


async def test_a_nul_in_the_path_or_query_is_refused(client: httpx.AsyncClient) -> None:
    for path in ("/errors/a%00b", "/loads?limit=%00"):
        answer = await client.get(path)

        assert_is_problem(answer, 400, "bad-request")


async def test_a_wrong_method_is_told_all_that_are_allowed(client: httpx.AsyncClient) -> None:
    answer = await client.patch("/loads")

    assert_is_problem(answer, 405, "method-not-allowed")
    assert answer.headers["allow"] == "DELETE, GET, POST"


async def test_an_unknown_path_is_a_problem(client: httpx.AsyncClient) -> None:
    assert_is_problem(await client.get("/nowhere"), 404, "not-found")
    assert_is_problem(await client.get("/loads/"), 404, "not-found")


async def test_a_body_above_the_limit_is_refused_with_the_limit(client: httpx.AsyncClient) -> None:
    answer = await client.post("/loads", content=b" " * 262_145)

    assert_is_problem(answer, 413, "too-large")
    assert "262144" in answer.json()["detail"]


async def test_a_chunked_body_above_the_limit_is_refused(client: httpx.AsyncClient) -> None:
    async def chunks() -> AsyncIterator[bytes]:
        for _ in range(5):
            yield b" " * 65_536

    headers = {"content-type": "application/json"}

    answer = await client.post("/loads", content=chunks(), headers=headers)

    assert_is_problem(answer, 413, "too-large")


async def test_a_route_may_take_larger_bodies(client: httpx.AsyncClient) -> None:
    within = await client.put("/big/one", content=b" " * 1_000_000)
    beyond = await client.put("/big/one", content=b" " * 1_000_001)

    assert within.json() == 1_000_000
    assert_is_problem(beyond, 413, "too-large")


async def test_a_route_that_reads_by_itself_complains_alike(client: httpx.AsyncClient) -> None:
    assert_is_problem(await client.put("/raw", content=b"[1,"), 400, "broken-json")
    assert_is_problem(await client.put("/raw", content=b"[NaN]"), 422, "invalid-input")
    assert_is_problem(await client.put("/raw", content=b"[" * 100_000), 422, "invalid-input")


async def test_an_internal_body_may_hold_unknown_fields(client: httpx.AsyncClient) -> None:
    body = {"order_id": "o1", "newer": 1, "load": {"price": 1, "newer": {}}}

    answer = await client.put("/internal/orders", json=body)

    assert answer.json() == "o1"


@pytest.mark.parametrize(
    ("body", "status", "name"),
    [
        (b"{", 400, "broken-json"),
        (b"", 400, "broken-json"),
        (b"[" * 100_000, 400, "broken-json"),
        (b'{"order_id": "o1", "load": {"price": "x"}}', 422, "invalid-input"),
        (b'{"order_id": "o1", "load": {"price": ' + b"9" * 5000 + b"}}", 400, "broken-json"),
    ],
)
async def test_an_internal_body_at_fault_is_a_problem(
    client: httpx.AsyncClient, body: bytes, status: int, name: str
) -> None:
    headers = {"content-type": "application/json"}

    answer = await client.put("/internal/orders", content=body, headers=headers)

    assert_is_problem(answer, status, name)
    assert status == 400 or fields_at_fault(answer) == ["load.price"]


async def test_a_trace_goes_on_under_a_span_of_our_own(client: httpx.AsyncClient) -> None:
    received = f"00-{TRACE_ID}-00f067aa0ba902b7-00"

    answer = await client.get("/trace", headers={"traceparent": received})

    assert re.fullmatch(f"00-{TRACE_ID}-[0-9a-f]{{16}}-00", answer.json())
    assert answer.json() != received


async def test_a_trace_begins_where_none_came_or_a_broken_one(client: httpx.AsyncClient) -> None:
    for headers in ({}, {"traceparent": "00-nonsense"}, {"traceparent": f"00-{'0' * 32}-x-01"}):
        answer = await client.get("/trace", headers=headers)

        assert re.fullmatch("00-[0-9a-f]{32}-[0-9a-f]{16}-01", answer.json())


async def test_a_process_is_alive_and_ready(client: httpx.AsyncClient) -> None:
    assert (await client.get("/healthz")).json() == {"service": "loads", "checks": {}}
    assert (await client.get("/readyz")).json() == {
        "service": "loads",
        "checks": {"database": True},
    }


async def test_what_is_missing_is_named() -> None:
    transport = httpx.ASGITransport(make_app(no_broker))
    async with httpx.AsyncClient(transport=transport, base_url="http://loads") as client:
        answer = await client.get("/readyz")

    assert_is_problem(answer, 503, "service-unavailable")
    assert "missing: broker" in answer.json()["detail"]


async def test_requests_are_counted(client: httpx.AsyncClient) -> None:
    await client.get("/loads")

    text = (await client.get("/metrics")).text

    assert 'skyway_http_requests_total{method="GET",route="/loads",status="200"}' in text


async def test_the_docs_page_asks_no_other_host(client: httpx.AsyncClient) -> None:
    page = await client.get("/docs")
    links = re.findall(r'(?:src|href)="([^"]+)"', page.text)

    assert len(links) == 3
    assert "://" not in page.text
    for link in links:
        assert (await client.get(link)).status_code == 200
    assert_is_problem(await client.get("/docs/assets/other"), 404, "not-found")


async def test_openapi_documents_problems_and_internal_bodies(client: httpx.AsyncClient) -> None:
    document = (await client.get("/openapi.json")).json()

    assert document["openapi"].startswith("3.1")
    responses = document["paths"]["/loads"]["post"]["responses"]
    assert {"200", "400", "413", "415", "422", "default"} <= set(responses)
    assert list(responses["400"]["content"]) == ["application/problem+json"]
    body = document["paths"]["/internal/orders"]["put"]["requestBody"]
    assert body["content"]["application/json"]["schema"]["$ref"].endswith("/Order")
    assert {"Order", "Load", "ProblemDetails", "FieldProblem"} <= set(
        document["components"]["schemas"]
    )
    assert "HTTPValidationError" not in json.dumps(document)
