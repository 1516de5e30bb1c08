"""How tests make keys and call with them."""

from typing import Any

import httpx

from tests.gateway.whole_gateway import Gateway


def bearer(issued: Any) -> dict[str, str]:
    """The header of an issued key."""
    return {"Authorization": f"Bearer {issued['key']}"}


async def ask_for_key(
    gateway: Gateway, *, by: dict[str, str] | None = None, **requested: Any
) -> httpx.Response:
    """The answer to POST /v1/keys by an operator: a customer's key unless said otherwise."""
    body = {"role": "customer", "subject_id": "carol", **requested}
    return await gateway.http.post("/v1/keys", json=body, headers=by or gateway.operator)


async def make_key(
    gateway: Gateway, *, by: dict[str, str] | None = None, **requested: Any
) -> dict[str, Any]:
    """A new key."""
    answer = await ask_for_key(gateway, by=by, **requested)
    assert answer.status_code == 201, answer.text
    issued: dict[str, Any] = answer.json()
    return issued


async def rotate(gateway: Gateway, issued: Any, **headers: str) -> httpx.Response:
    """The answer to a rotation of a key."""
    return await gateway.http.post("/v1/keys/rotations", headers={**bearer(issued), **headers})


async def status_of(gateway: Gateway, issued: Any, path: str = "/v1/clock") -> int:
    """The status of a GET with this key."""
    return (await gateway.http.get(path, headers=bearer(issued))).status_code
