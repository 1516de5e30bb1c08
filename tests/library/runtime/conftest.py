"""A service with a route for each answer that all services share."""

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Annotated, Any

import httpx
import pytest
from fastapi import Depends, FastAPI, Request
from pydantic import Field

from skyway.errors import InvalidInput
from skyway.json_model import JsonModel
from skyway.runtime.errors import (
    AccessDenied,
    BudgetSpent,
    Conflict,
    IdempotencyKeyReused,
    MqttUnavailable,
    NotFound,
    PreconditionFailed,
    RemoteProblem,
    RowRefused,
    ServiceUnavailable,
    TooLarge,
    Unauthenticated,
)
from skyway.runtime.http.app import create_app, internal_body, read_json, takes_bytes
from skyway.runtime.http.body_bounds import BODY_LIMIT_BYTES
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.tracing import current_traceparent


class Crate(JsonModel):
    mass_kg: Annotated[float, Field(ge=0)]


class Load(JsonModel):
    crates: Annotated[tuple[Crate, ...], Field(max_length=50)] = ()
    price: int = 0
    notes: dict[str, Any] = Field(default_factory=dict)


class Order(JsonModel):
    order_id: str
    load: Load = Load()


router = ServiceRouter()


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
@takes_bytes(1_000_000)
async def put_big(name: str, request: Request) -> int:
    return len(await request.body())


@router.put("/raw")
@takes_bytes(BODY_LIMIT_BYTES)
async def put_raw(request: Request) -> Any:
    return await read_json(request)


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
    "taken": RowRefused("one_mission_per_drone"),
    "changed": PreconditionFailed(expected="1", present="2"),
    "large": TooLarge(7),
    "spent": BudgetSpent("CALLS", 0.4),
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


@asynccontextmanager
async def nothing_to_open(_app: FastAPI) -> AsyncIterator[None]:
    yield


def make_loads_app(readiness: Any = everything_there) -> FastAPI:
    return create_app(
        service="loads",
        title="Loads",
        description="For tests.",
        routers=[router],
        lifespan=nothing_to_open,
        readiness=readiness,
    )


@pytest.fixture
def make_app() -> Callable[..., FastAPI]:
    return make_loads_app


@pytest.fixture
async def client() -> AsyncIterator[httpx.AsyncClient]:
    transport = httpx.ASGITransport(make_loads_app())
    async with httpx.AsyncClient(transport=transport, base_url="http://loads") as opened:
        yield opened


@pytest.fixture
def fields_at_fault() -> Callable[[httpx.Response], list[str]]:
    def fields(answer: httpx.Response) -> list[str]:
        return [problem["field"] for problem in answer.json()["errors"]]

    return fields


@pytest.fixture
def assert_is_problem() -> Callable[[httpx.Response, int, str], None]:
    def check(answer: httpx.Response, status: int, name: str) -> None:
        assert answer.status_code == status, answer.text
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.json()["type"] == f"urn:skyway:problem:{name}"
        assert answer.json()["status"] == status

    return check
