"""Test keys, and test deliveries that are played to their end."""

from datetime import timedelta
from typing import Any

from skyway_gateway.sandbox.outcomes import Outcome

from tests.gateway.whole_gateway import Gateway

#: How many reports a mission has at most, here.
_MOST_STEPS = 40


async def sandbox_caller(gateway: Gateway, holder: dict[str, str] | None = None) -> dict[str, str]:
    """The headers of a test key that a customer has made for itself."""
    headers = holder or gateway.customer
    answer = await gateway.http.post("/v1/keys", json={"livemode": False}, headers=headers)
    assert answer.status_code == 201, answer.text
    return {"Authorization": f"Bearer {answer.json()['key']}"}


def sandbox_request(destination: str = "library", **changes: Any) -> dict[str, Any]:
    """A request for one package from the harbour of the sandbox."""
    package = {"package_id": "p1", "mass_kg": 0.5, "destination": {"station_id": destination}}
    return {"pickup": {"station_id": "harbour"}, "packages": [package], **changes}


def request_for(outcome: Outcome, **changes: Any) -> dict[str, Any]:
    """A request for which this outcome is possible: a wrong PIN needs a right one."""
    body = sandbox_request(**changes)
    if outcome.name == "wrong_pin":
        body["packages"][0]["dropoff_verification"] = {"method": "PIN", "pin": "4711"}
    return body


async def accepted(gateway: Gateway, headers: dict[str, str], body: dict[str, Any]) -> str:
    """The id of a test delivery that was just accepted."""
    answer = await gateway.http.post("/v1/deliveries", json=body, headers=headers)
    assert answer.status_code == 202, answer.text
    return str(answer.json()["delivery_id"])


async def step(gateway: Gateway) -> None:
    """Let half a second pass: book what is due, and play what is due."""
    while await gateway.book_next():
        pass
    gateway.clock.advance(timedelta(seconds=0.5))
    await gateway.parts.player.step()


async def shown(gateway: Gateway, headers: dict[str, str], delivery_id: str) -> dict[str, Any]:
    """A delivery as its customer sees it."""
    answer = await gateway.http.get(f"/v1/deliveries/{delivery_id}", headers=headers)
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


async def played(gateway: Gateway, headers: dict[str, str], delivery_id: str) -> dict[str, Any]:
    """The delivery at its end."""
    for _ in range(_MOST_STEPS):
        found = await shown(gateway, headers, delivery_id)
        if found["state"] in ("COMPLETED", "FAILED", "CANCELLED", "REJECTED"):
            await step(gateway)
            await step(gateway)
            return found
        await step(gateway)
    raise AssertionError(f"{delivery_id} is still {found['state']}")
