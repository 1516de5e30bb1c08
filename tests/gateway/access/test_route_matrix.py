"""Every public call by every caller, made from the OpenAPI document that says who may call."""

import json
import re
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from skyway.runtime.http.delays import WrongKeys
from tests.gateway.access.test_entrance import limit
from tests.gateway.whole_gateway import Gateway

_DOCUMENT = json.loads(
    (Path(__file__).parents[3] / "openapi" / "gateway.json").read_text(encoding="utf-8")
)
#: What needs no key: the service's own state, the token in the body of an enrolment, and the
#: address of a photo.
_OPEN = {
    *("GET /healthz", "GET /readyz", "GET /metrics"),
    *("POST /v1/enrolments", "PUT /v1/proofs/uploads/{token}"),
}
#: Its first event needs loops, which do not run here: it is answered with 503.
_NEEDS_LOOPS = "GET /v1/live"
#: The registry refuses a wrong body; the one of these tests answers with no provider then.
_MAKES_A_PROVIDER = "POST /v1/providers"
_ROLES = ("customer", "provider", "operator", "drone")
_REFUSED = {401, 403}


@dataclass(frozen=True)
class Operation:
    method: str
    path: str
    callers: frozenset[str]
    body: Any  # any JSON value

    @property
    def name(self) -> str:
        return f"{self.method} {self.path}"

    def url(self, *, provider_id: str = "prv_1") -> str:
        """The path with ids; everything but the provider is absent."""
        path = self.path.replace("{provider_id}", provider_id).replace("{pad}", "1")
        return re.sub(r"\{\w+\}", "absent", path)


def _operations() -> list[Operation]:
    return [
        Operation(
            method.upper(),
            path,
            _callers(operation),
            operation.get("requestBody", {}).get("content", {}).get("application/json", {}),
        )
        for path, item in _DOCUMENT["paths"].items()
        for method, operation in item.items()
        if method != "parameters"
    ]


def _callers(operation: dict[str, Any]) -> frozenset[str]:
    stated = re.search(r"Callers: ([\w, ]+)\.", operation.get("description", ""))
    if stated is None:
        return frozenset()
    is_open = stated[1] in ("every API key", "every API key and every drone")
    return frozenset(_ROLES if is_open else stated[1].split(", "))


GUARDED = [each for each in _operations() if each.name not in _OPEN]
OF_PROVIDERS = [each for each in GUARDED if "{provider_id}" in each.path]


async def _status(gateway: Gateway, operation: Operation, url: str, headers: Any) -> int:
    body = operation.body.get("example")
    async with gateway.http.stream(
        operation.method, url, json=body if operation.body else None, headers=headers
    ) as answer:
        return answer.status_code


def test_every_operation_says_who_may_call_it() -> None:
    assert {each.name for each in GUARDED if not each.callers} == set()
    assert {role for each in GUARDED for role in each.callers} == set(_ROLES)


async def test_only_the_stated_callers_get_in(gateway: Gateway, subtests: pytest.Subtests) -> None:
    gateway.is_damaged = True  # examples of bodies are not true of this gateway
    gateway.parts.live.first_look_within_s = 0.0
    for operation in GUARDED:
        with subtests.test(operation.name):
            answers = {}
            for role in _ROLES:
                gateway.http.cookies.clear()  # an earlier login would refuse this call
                headers = getattr(gateway, role)
                answers[role] = await _status(gateway, operation, operation.url(), headers)

            got_in = {role for role, status in answers.items() if status not in _REFUSED}
            assert got_in == operation.callers, answers
            assert max(answers.values()) < 500 or operation.name == _NEEDS_LOOPS, answers


def _never_waits(gateway: Gateway) -> None:
    """Have no address wait that shows many wrong keys: an hour passes between two of them."""
    limit(gateway, addresses=100_000)
    hours = count(step=3600.0)
    entrance = replace(gateway.parts.entrance, wrong_keys=WrongKeys(now=lambda: next(hours)))
    # Parts are frozen: only a test replaces one.
    object.__setattr__(gateway.parts, "entrance", entrance)


async def test_no_secret_but_a_key_in_use_opens_the_gateway(gateway: Gateway) -> None:
    _never_waits(gateway)
    revoked = await gateway.http.post(
        "/v1/keys", json={"role": "operator", "subject_id": "gone"}, headers=gateway.operator
    )
    await gateway.http.delete(f"/v1/keys/{revoked.json()['key_id']}", headers=gateway.operator)
    shown = {
        "none": {},
        "not a bearer": {"Authorization": "Basic b3BlcmF0b3I6eA=="},
        "unknown": {"Authorization": "Bearer sk_unknown"},
        "revoked": {"Authorization": f"Bearer {revoked.json()['key']}"},
        "unknown drone": {"Authorization": "Bearer dk_unknown"},
        "another service": _secret(gateway, "service_composition"),
        "this service": _secret(gateway, "service_gateway"),
        "names an operator": {
            **_secret(gateway, "service_composition"),
            "Skyway-Caller": "operator:x",
        },
    }

    answers = {
        (operation.name, name): await _status(gateway, operation, operation.url(), headers)
        for operation in GUARDED
        for name, headers in shown.items()
    }

    assert {call: status for call, status in answers.items() if status != 401} == {}


@pytest.mark.parametrize("depth", [150, 450, 950, 4_000])
@pytest.mark.parametrize(("opened", "closed"), [("[", "]"), ('{"qos":', "}")])
async def test_no_body_that_nests_deeply_is_a_fault_of_the_gateway(
    gateway: Gateway, depth: int, opened: str, closed: str
) -> None:
    gateway.is_damaged = True  # what is forwarded is not checked here
    limit(gateway, tenants=10_000, refusals=10_000, addresses=10_000)
    body = opened * depth + ("1" if closed == "}" else "") + closed * depth
    answers = {}
    for operation in (each for each in GUARDED if each.body and each.name != _MAKES_A_PROVIDER):
        for role in ("customer", "provider", "operator"):
            headers = {**getattr(gateway, role), "Content-Type": "application/json"}
            gateway.http.cookies.clear()
            answer = await gateway.http.request(
                operation.method, operation.url(), content=body, headers=headers
            )
            answers[operation.name, role] = answer.status_code

    assert {call: status for call, status in answers.items() if status >= 500} == {}
    assert len(answers) > 20


async def test_a_provider_of_another_looks_like_one_that_does_not_exist(gateway: Gateway) -> None:
    answers = {
        operation.name: await _status(
            gateway, operation, operation.url(provider_id="prv_foreign"), gateway.provider
        )
        for operation in OF_PROVIDERS
    }

    assert answers == dict.fromkeys(answers, 404)
    assert len(answers) > 10


def _secret(gateway: Gateway, name: str) -> dict[str, str]:
    secret = (gateway.secrets_dir / name).read_text(encoding="utf-8").strip()
    return {"Authorization": f"Bearer {secret}"}
