"""Services call each other and forward whole requests."""

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI, Request, Response

from skyway.json_model import JsonModel
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.http.app import create_app, takes_bytes
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import Caller, ServiceIdentity
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.tracing import trace_id_of, tracing


class Parcel(JsonModel):
    name: str


Answer = Callable[[httpx.Request], httpx.Response]


@pytest.fixture
def identity(tmp_path: Path) -> ServiceIdentity:
    (tmp_path / "service_gateway").write_text("for-the-gateway")
    return ServiceIdentity("gateway", tmp_path)


@pytest.fixture
def client_for(identity: ServiceIdentity) -> Callable[[Answer], ServiceClient]:
    def make(answer: Answer) -> ServiceClient:
        transport = httpx.MockTransport(answer)
        return ServiceClient("registry", "http://registry", identity, transport=transport)

    return make


async def test_a_call_carries_body_caller_secret_and_trace(
    client_for: Callable[[Answer], ServiceClient],
) -> None:
    seen: list[httpx.Request] = []

    def answer(request: httpx.Request) -> httpx.Response:
        seen.append(request)
        return httpx.Response(200, json={"name": "b", "newer": 1})

    with tracing(None) as traceparent:
        async with client_for(answer) as registry:
            parcel = await registry.call(
                "PUT",
                "/internal/parcels",
                body=Parcel(name="a"),
                answer=Parcel,
                caller=Caller("customer", "c1"),
                query={"limit": "1"},
            )

    assert parcel == Parcel(name="b")
    assert str(seen[0].url) == "http://registry/internal/parcels?limit=1"
    assert seen[0].content == b'{"name":"a"}'
    assert seen[0].headers["authorization"] == "Bearer for-the-gateway"
    assert seen[0].headers["skyway-caller"] == "customer:c1"
    assert seen[0].headers["traceparent"] == traceparent


async def test_an_answer_may_be_a_list_or_nothing(
    client_for: Callable[[Answer], ServiceClient],
) -> None:
    async with client_for(lambda _: httpx.Response(200, json=[{"name": "b"}])) as registry:
        assert await registry.call("GET", "/parcels", answer=list[Parcel]) == [Parcel(name="b")]
        await registry.call("DELETE", "/parcels/b")


async def test_a_refusal_is_a_remote_problem(
    client_for: Callable[[Answer], ServiceClient],
) -> None:
    problem = {"type": "urn:x", "title": "No", "status": 409, "code": "TOO_LATE", "why": 7}
    async with client_for(lambda _: httpx.Response(409, json=problem)) as registry:
        with pytest.raises(RemoteProblem) as raised:
            await registry.call("POST", "/parcels")

    assert raised.value.status == 409
    assert raised.value.problem["code"] == "TOO_LATE"
    assert raised.value.problem["why"] == 7


async def test_a_refusal_without_a_problem_document_is_one_too(
    client_for: Callable[[Answer], ServiceClient],
) -> None:
    async with client_for(lambda _: httpx.Response(404, text="<html>")) as registry:
        with pytest.raises(RemoteProblem) as raised:
            await registry.call("GET", "/parcels")

    assert raised.value.problem["status"] == 404


@pytest.mark.parametrize(
    "response",
    [
        httpx.Response(503),
        httpx.Response(500),
        httpx.Response(401),
        httpx.Response(200, text="no JSON"),
    ],
)
async def test_a_service_that_fails_or_does_not_know_us_is_unavailable(
    client_for: Callable[[Answer], ServiceClient], response: httpx.Response
) -> None:
    async with client_for(lambda _: response) as registry:
        with pytest.raises(ServiceUnavailable, match="registry"):
            await registry.call("GET", "/parcels", answer=Parcel)


@pytest.mark.parametrize("error", [httpx.ConnectError("x"), httpx.ReadTimeout("x")])
async def test_a_service_that_cannot_be_reached_is_unavailable(
    client_for: Callable[[Answer], ServiceClient], error: httpx.TransportError
) -> None:
    def fail(_request: httpx.Request) -> httpx.Response:
        raise error

    async with client_for(fail) as registry:
        with pytest.raises(ServiceUnavailable, match="registry"):
            await registry.call("GET", "/parcels")


async def test_a_client_that_is_not_open_says_so(
    client_for: Callable[[Answer], ServiceClient],
) -> None:
    with pytest.raises(ServiceUnavailable, match="not open"):
        await client_for(lambda _: httpx.Response(200)).call("GET", "/parcels")


async def ready() -> dict[str, bool]:
    return {}


def make_gateway(registry: ServiceClient) -> FastAPI:
    """A gateway that forwards all under /v1 to the registry, for the operator o1."""
    router = ServiceRouter()

    def limit_of(request: Request) -> int:
        return 10_000_000 if "/networks/" in request.url.path else 256 * 1024

    @router.api_route("/v1/{path:path}", methods=["GET", "PUT", "POST", "DELETE"])
    @takes_bytes(limit_of)
    async def forward(path: str, request: Request) -> Response:
        return await registry.forward(request, f"/v1/{path}", Caller("operator", "o1"))

    @asynccontextmanager
    async def opened(_app: FastAPI) -> AsyncIterator[None]:
        yield

    return create_app(
        service="gateway",
        title="Gateway",
        description="",
        routers=[router],
        lifespan=opened,
        readiness=ready,
    )


def make_registry(seen: list[dict[str, Any]]) -> FastAPI:
    registry = FastAPI()

    @registry.api_route("/v1/{path:path}", methods=["GET", "PUT", "POST", "DELETE"])
    async def answer(path: str, request: Request) -> Response:
        body = await request.body()
        seen.append(
            {"path": path, "query": request.url.query, "body": body} | dict(request.headers)
        )
        if path == "secret":
            return Response(status_code=401)
        if path == "none":
            return Response(status_code=204)
        headers = {"Location": "/v1/x", "ETag": '"2"', "Set-Cookie": "inside"}
        return Response(b"b" * 100, 201, headers, "application/geo+json")

    return registry


@pytest.fixture
def seen() -> list[dict[str, Any]]:
    return []


@pytest.fixture
async def gateway(
    identity: ServiceIdentity, seen: list[dict[str, Any]]
) -> AsyncIterator[httpx.AsyncClient]:
    inside = httpx.ASGITransport(make_registry(seen))
    async with ServiceClient("registry", "http://registry", identity, transport=inside) as registry:
        outside = httpx.ASGITransport(make_gateway(registry))
        async with httpx.AsyncClient(transport=outside, base_url="http://gateway") as client:
            yield client


async def test_a_forwarded_request_carries_only_the_headers_it_needs(
    gateway: httpx.AsyncClient, seen: list[dict[str, Any]]
) -> None:
    headers = {
        "Authorization": "Bearer the-customers-own",
        "Skyway-Caller": "operator:somebody-else",
        "Content-Type": "application/geo+json",
        "Idempotency-Key": "k1",
        "If-Match": '"1"',
        "Cookie": "a=b",
        "traceparent": "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
    }

    answer = await gateway.put("/v1/a?limit=2&cursor=x", content=b"body", headers=headers)

    assert answer.status_code == 201
    assert answer.content == b"b" * 100
    assert answer.headers["location"] == "/v1/x"
    assert answer.headers["etag"] == '"2"'
    assert answer.headers["content-type"] == "application/geo+json"
    assert "set-cookie" not in answer.headers
    arrived = seen[0]
    assert (arrived["path"], arrived["query"]) == ("a", "limit=2&cursor=x")
    assert arrived["body"] == b"body"
    assert arrived["authorization"] == "Bearer for-the-gateway"
    assert arrived["skyway-caller"] == "operator:o1"
    assert arrived["idempotency-key"] == "k1"
    assert arrived["if-match"] == '"1"'
    assert arrived["content-type"] == "application/geo+json"
    assert "cookie" not in arrived
    assert trace_id_of(arrived["traceparent"]) == "4bf92f3577b34da6a3ce929d0e0e4736"


async def test_a_forwarded_header_may_hold_any_character(
    gateway: httpx.AsyncClient, seen: list[dict[str, Any]]
) -> None:
    headers = {b"If-Match": '"\xff"'.encode("latin-1")}

    answer = await gateway.put("/v1/a", content=b"body", headers=headers)

    assert answer.status_code == 201
    assert seen[0]["if-match"] == '"\xff"'


async def test_an_answer_without_a_body_is_passed_on(gateway: httpx.AsyncClient) -> None:
    answer = await gateway.delete("/v1/none")

    assert (answer.status_code, answer.content) == (204, b"")


async def test_a_large_body_is_passed_on_in_parts(
    gateway: httpx.AsyncClient, seen: list[dict[str, Any]]
) -> None:
    async def parts() -> AsyncIterator[bytes]:
        for _ in range(50):
            yield b"x" * 100_000

    answer = await gateway.put("/v1/networks/n1", content=parts())

    assert answer.status_code == 201
    assert len(seen[0]["body"]) == 5_000_000


async def test_a_forwarded_body_above_the_limit_is_refused(gateway: httpx.AsyncClient) -> None:
    async def parts() -> AsyncIterator[bytes]:
        for _ in range(50):
            yield b"x" * 100_000

    answer = await gateway.put("/v1/other", content=parts())

    assert answer.status_code == 413
    assert answer.json()["type"] == "urn:skyway:problem:too-large"


async def test_a_secret_refused_between_services_is_not_the_callers_fault(
    gateway: httpx.AsyncClient,
) -> None:
    answer = await gateway.get("/v1/secret")

    assert answer.status_code == 503


async def test_a_path_cannot_climb_out_of_its_place(
    gateway: httpx.AsyncClient, seen: list[dict[str, Any]]
) -> None:
    assert (await gateway.get("/v1/%2e%2e/internal/x")).status_code == 404
    assert (await gateway.get("/v1/..%2Finternal")).status_code == 400

    assert seen == []
