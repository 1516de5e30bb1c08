"""Who may call a service, and for whom."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Annotated

import httpx
import pytest
from fastapi import Depends, FastAPI

from skyway.runtime.errors import InvalidSettings, Unauthenticated
from skyway.runtime.http.app import create_app
from skyway.runtime.http.identity import Caller, ServiceGate, ServiceIdentity
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.peer_secrets import read_secret


async def ready() -> dict[str, bool]:
    return {}


@asynccontextmanager
async def nothing_to_open(_app: FastAPI) -> AsyncIterator[None]:
    yield


@pytest.fixture
def secrets_dir(tmp_path: Path) -> Path:
    (tmp_path / "service_gateway").write_text("for-the-gateway\n")
    (tmp_path / "service_composition").write_text("for-composition\n")
    return tmp_path


@pytest.fixture
async def client(secrets_dir: Path) -> AsyncIterator[httpx.AsyncClient]:
    router = ServiceRouter()
    gate = ServiceGate(secrets_dir, ("gateway",))

    @router.get("/who")
    async def who(caller: Annotated[Caller, Depends(gate)]) -> str:
        return str(caller)

    app = create_app(
        service="registry",
        title="Registry",
        description="",
        routers=[router],
        lifespan=nothing_to_open,
        readiness=ready,
    )
    transport = httpx.ASGITransport(app)
    async with httpx.AsyncClient(transport=transport, base_url="http://registry") as opened:
        yield opened


async def test_a_service_with_a_secret_names_its_caller(
    client: httpx.AsyncClient, secrets_dir: Path
) -> None:
    headers = ServiceIdentity("gateway", secrets_dir).headers(Caller("customer", "c1"))

    answer = await client.get("/who", headers=headers)

    assert answer.json() == "customer:c1"


async def test_a_service_without_a_caller_speaks_for_itself(
    client: httpx.AsyncClient, secrets_dir: Path
) -> None:
    headers = ServiceIdentity("gateway", secrets_dir).headers(None)

    assert (await client.get("/who", headers=headers)).json() == "service:gateway"
    del headers["Skyway-Caller"]
    assert (await client.get("/who", headers=headers)).json() == "service:gateway"


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Skyway-Caller": "operator:o1"},
        {"Authorization": "Bearer for-composition", "Skyway-Caller": "operator:o1"},
        {"Authorization": "Bearer ", "Skyway-Caller": "operator:o1"},
        {"Authorization": "Basic for-the-gateway", "Skyway-Caller": "operator:o1"},
        {"Authorization": "Bearer for-the-gateway", "Skyway-Caller": "emperor:o1"},
        {"Authorization": "Bearer for-the-gateway", "Skyway-Caller": "operator:"},
        {"Authorization": "Bearer for-the-gateway", "Skyway-Caller": "operator:a b"},
    ],
)
async def test_a_caller_without_a_service_secret_is_refused(
    client: httpx.AsyncClient, headers: dict[str, str]
) -> None:
    answer = await client.get("/who", headers=headers)

    assert answer.status_code == 401
    assert answer.json()["type"] == "urn:skyway:problem:unauthenticated"


def test_a_caller_survives_the_wire() -> None:
    caller = Caller("provider", "prov_1")

    assert Caller.parse(str(caller)) == caller
    with pytest.raises(Unauthenticated):
        Caller.parse("provider")


def test_a_missing_or_empty_secret_is_named(tmp_path: Path) -> None:
    (tmp_path / "mqtt_gateway").write_text("\n")

    for name in ("mqtt_gateway", "mqtt_registry"):
        with pytest.raises(InvalidSettings, match=name):
            read_secret(tmp_path, name)
