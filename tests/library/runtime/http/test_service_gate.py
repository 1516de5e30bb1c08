"""Services say who they are by a secret, and only the gateway speaks for others."""

from pathlib import Path

import pytest
from fastapi import Request

from skyway.runtime.errors import AccessDenied, Unauthenticated
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.peer_secrets import peer_file, secret_hash


@pytest.fixture
def gate(tmp_path: Path) -> ServiceGate:
    for name in ("gateway", "registry", "composition"):
        (tmp_path / f"service_{name}").write_text(f"secret of {name}\n")
    return ServiceGate(tmp_path, allowed=("gateway", "registry"))


def request(*, secret: str | None, caller: str | None = None, path: str = "/internal/x") -> Request:
    headers = []
    if secret is not None:
        headers.append((b"authorization", f"Bearer {secret}".encode()))
    if caller is not None:
        headers.append((b"skyway-caller", caller.encode()))
    return Request({"type": "http", "path": path, "headers": headers})


async def test_a_hash_of_a_secret_is_enough_to_recognise_a_service(
    gate: ServiceGate, tmp_path: Path
) -> None:
    (tmp_path / "service_gateway").unlink()
    (tmp_path / peer_file("gateway")).write_text(secret_hash("secret of gateway") + "\n")

    assert await gate(request(secret="secret of gateway")) == Caller("service", "gateway")
    with pytest.raises(Unauthenticated):
        await gate(request(secret=secret_hash("secret of gateway")))


async def test_the_gateway_speaks_for_whom_it_names(gate: ServiceGate) -> None:
    operator = await gate(request(secret="secret of gateway", caller="operator:olga"))
    itself = await gate(request(secret="secret of gateway"))

    assert (operator, itself) == (Caller("operator", "olga"), Caller("service", "gateway"))


@pytest.mark.parametrize(
    "caller", ["operator:olga", "customer:ada", "service:gateway", "drone:drn_1"]
)
async def test_another_service_speaks_for_itself_only(gate: ServiceGate, caller: str) -> None:
    with pytest.raises(AccessDenied, match="may not speak for"):
        await gate(request(secret="secret of registry", caller=caller))


async def test_a_service_may_name_itself(gate: ServiceGate) -> None:
    named = await gate(request(secret="secret of registry", caller="service:registry"))

    assert named == Caller("service", "registry")


async def test_another_service_may_not_call_what_people_call(gate: ServiceGate) -> None:
    with pytest.raises(AccessDenied, match="what people call"):
        await gate(request(secret="secret of registry", path="/v1/networks"))


@pytest.mark.parametrize("secret", [None, "", "secret of composition", "sk_something", "ü"])
async def test_other_secrets_are_refused(gate: ServiceGate, secret: str | None) -> None:
    with pytest.raises(Unauthenticated):
        await gate(request(secret=secret))


def test_a_call_for_one_service_is_closed_to_others_and_to_people() -> None:
    Caller("service", "gateway").must_be_service("gateway", "registry")

    for other in (Caller("service", "composition"), Caller("operator", "gateway")):
        with pytest.raises(AccessDenied, match="for the service gateway or registry"):
            other.must_be_service("gateway", "registry")
