"""What belongs to another tenant is answered exactly like what does not exist."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import pytest

from tests.gateway.access.test_route_matrix import GUARDED, Operation
from tests.gateway.whole_gateway import Gateway, make_request

#: The objects of customers that the gateway keeps.
_IDS: Final = ("delivery_id", "webhook_id", "quote_id")
OF_CUSTOMERS: Final = [
    each
    for each in GUARDED
    if "customer" in each.callers and any(f"{{{name}}}" in each.path for name in _IDS)
]
#: The host of the example cannot be looked up here, and a webhook's URL is checked first.
_BODIES: Final = {"PATCH /v1/webhooks/{webhook_id}": {"url": "http://127.0.0.1:9/"}}
#: Headers that differ from call to call.
_BUDGET: Final = "ratelimit-"


@dataclass(frozen=True, slots=True)
class Answer:
    """What a caller can learn from an answer."""

    status: int
    body: str
    headers: dict[str, str]


async def ask(
    gateway: Gateway, call: tuple[str, str, Any], object_id: str, headers: dict[str, str]
) -> Answer:
    """The answer, with the object's id and the ids of the trace left out."""
    method, url, body = call
    found = await gateway.http.request(method, url, json=body, headers=headers)
    shown = re.sub(r'"trace_id": "\w+"', "", found.text.replace(object_id, "ID"))
    names = {name: value for name, value in found.headers.items() if _BUDGET not in name}
    return Answer(found.status_code, shown, names)


@pytest.fixture
async def ids(gateway: Gateway, request_body: Callable[..., Any]) -> dict[str, str]:
    """A delivery under way, a webhook and a quote of alice."""
    gateway.is_damaged = True  # examples of bodies are not true of this gateway
    body = {"url": "http://127.0.0.1:9/"}
    webhook = await gateway.http.post("/v1/webhooks", json=body, headers=gateway.customer)
    quote = await gateway.http.post("/v1/quotes", json=request_body(), headers=gateway.customer)
    return {
        "delivery_id": await _signed(gateway),
        "webhook_id": webhook.json()["webhook_id"],
        "quote_id": quote.json()["quote_id"],
    }


async def _signed(gateway: Gateway) -> str:
    """The id of a delivery under way, for whose package a recipient has signed."""
    requested = make_request()
    requested["packages"][0]["dropoff_verification"] = {"method": "SIGNATURE"}
    delivery_id: str = (await gateway.post(requested)).json()["delivery_id"]
    while await gateway.book_next():
        pass
    signed = """UPDATE proofs SET signature = '{"name": "Ana Ruiz"}', given_by = 'RECIPIENT',
        given_ms = 1"""
    await gateway.execute(signed)
    return delivery_id


def absent(object_id: str) -> str:
    """An id like this one that no object has."""
    return object_id[:-1] + ("0" if object_id[-1] != "0" else "1")


def call_of(operation: Operation, name: str, object_id: str) -> tuple[str, str, Any]:
    """The method, the path with this id, and a body."""
    url = operation.path.replace(f"{{{name}}}", object_id).replace("{package_id}", "p1")
    example = operation.body.get("example") if operation.body else None
    return operation.method, url, _BODIES.get(operation.name, example)


@pytest.mark.parametrize("operation", OF_CUSTOMERS, ids=lambda each: each.name)
async def test_what_another_customer_has_looks_absent(
    gateway: Gateway, ids: dict[str, str], operation: Operation
) -> None:
    [name] = [name for name in _IDS if f"{{{name}}}" in operation.path]
    own, none = ids[name], absent(ids[name])

    foreign = await ask(gateway, call_of(operation, name, own), own, gateway.other)
    missing = await ask(gateway, call_of(operation, name, none), none, gateway.other)

    assert foreign == missing
    assert foreign.status == 404
    if not operation.path.endswith("/events"):  # its own stream does not end
        shown = await ask(gateway, call_of(operation, name, own), own, gateway.customer)
        assert shown.status != 404  # so the comparison was of an object that exists


async def test_an_offer_of_another_customers_quote_looks_absent(
    gateway: Gateway, ids: dict[str, str]
) -> None:
    own, none = ids["quote_id"], absent(ids["quote_id"])
    quote = (await gateway.http.get(f"/v1/quotes/{own}", headers=gateway.customer)).json()

    def accepting(quote_id: str) -> tuple[str, str, Any]:
        body = {"quote_id": quote_id, "offer_id": quote["offers"][0]["offer_id"]}
        return "POST", "/v1/deliveries", body

    foreign = await ask(gateway, accepting(own), own, gateway.other)
    missing = await ask(gateway, accepting(none), none, gateway.other)

    assert foreign == missing
    assert foreign.status == 404


async def test_no_list_of_another_customer_holds_them(
    gateway: Gateway, ids: dict[str, str]
) -> None:
    for path in ("/v1/deliveries", "/v1/webhooks"):
        own = await gateway.http.get(path, headers=gateway.customer)
        others = await gateway.http.get(path, headers=gateway.other)
        assert own.json()["items"] != []
        assert others.json()["items"] == []


async def test_another_customers_key_looks_like_no_key(gateway: Gateway) -> None:
    for method in ("GET", "DELETE"):
        answers = [
            await ask(gateway, (method, f"/v1/keys/{key_id}", None), key_id, gateway.customer)
            for key_id in ("key_other", "key_nobdy")
        ]
        assert answers[0] == answers[1]
        assert answers[0].status == 404


@pytest.mark.parametrize("role", ["provider", "drone"])
async def test_keys_look_alike_to_all_but_operators(gateway: Gateway, role: str) -> None:
    """Also a key of the caller's own."""
    headers = getattr(gateway, role)
    for method in ("GET", "DELETE"):
        answers = [
            await ask(gateway, (method, f"/v1/keys/{key_id}", None), key_id, headers)
            for key_id in (f"key_{role}", "key_operator", "key_absent")
        ]
        assert answers[0] == answers[1] == answers[2]
        assert answers[0].status == 403


def test_every_object_of_customers_is_tried() -> None:
    tried = {name for each in OF_CUSTOMERS for name in re.findall(r"\{(\w+)\}", each.path)}

    assert tried == {*_IDS, "package_id"}
    assert len(OF_CUSTOMERS) > 12
