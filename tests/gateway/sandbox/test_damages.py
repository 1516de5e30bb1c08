"""`skyway verify` sees test deliveries where they do not belong, and missions that do not fit."""

import pytest
from skyway_verifier.across.rules import DELIVERY_RULES
from skyway_verifier.facts import DeliveryFacts

from tests.gateway.sandbox.played import accepted, played, sandbox_caller, sandbox_request
from tests.gateway.whole_gateway import Gateway

_MODE = "a delivery's id says whether its customer is a test account"
_SCRIPT = "a test delivery has the reports of its own missions, in order"


@pytest.mark.parametrize(
    ("damage", "rule"),
    [
        ("UPDATE deliveries SET customer_id = 'alice'", _MODE),
        ("UPDATE sandbox_missions SET played = played - 1", _SCRIPT),
        ("UPDATE sandbox_missions SET attempt = 2", _SCRIPT),
        ("UPDATE sandbox_missions SET reports = '[]'", _SCRIPT),
        ("UPDATE missions SET report_seq = report_seq - 1", _SCRIPT),
    ],
)
async def test_a_damaged_test_delivery_is_seen(gateway: Gateway, damage: str, rule: str) -> None:
    gateway.is_damaged = True
    headers = await sandbox_caller(gateway)
    await played(gateway, headers, await accepted(gateway, headers, sandbox_request()))

    await gateway.execute(damage)

    assert rule in await gateway.verified()


def test_a_test_delivery_in_composition_is_seen() -> None:
    [rule] = [each for each in DELIVERY_RULES if each.name == "composition knows no test delivery"]
    test, live = (DeliveryFacts(each, is_over=False) for each in ("dlv_test_1", "dlv_1"))

    assert [*rule.finder(test, None)] == ["dlv_test_1"]
    assert [*rule.finder(live, None)] == []
