"""What customers see of a delivery ends with the delivery; operators and providers see all."""

import json
from typing import Any

import pytest

from tests.gateway.whole_gateway import Gateway

#: What a customer's documents never name.
AFTERWARDS = ("home_plan", "home_recharge", "released_at", "stats", "labels")

READS = ("/v1/deliveries", "/v1/deliveries/{}", "/v1/deliveries/{}/plan")


async def read(gateway: Gateway, path: str, headers: dict[str, str]) -> str:
    answer = await gateway.http.get(path, headers=headers)
    assert answer.status_code == 200, answer.text
    return answer.text


def named(text: str) -> set[str]:
    """Which of the members are in this JSON."""
    assert '"missions":[{' in text.replace(" ", "")
    return {name for name in AFTERWARDS if f'"{name}"' in text}


@pytest.mark.parametrize("path", READS)
async def test_a_customer_sees_no_way_home_and_no_counters(gateway: Gateway, path: str) -> None:
    delivery_id = await gateway.planned()

    assert named(await read(gateway, path.format(delivery_id), gateway.customer)) == set()


@pytest.mark.parametrize("path", READS)
async def test_an_operator_sees_all(gateway: Gateway, path: str) -> None:
    delivery_id = await gateway.planned()

    seen = named(await read(gateway, path.format(delivery_id), gateway.operator))

    assert seen == set(AFTERWARDS)


async def test_the_provider_of_the_drone_sees_all(gateway: Gateway) -> None:
    await gateway.planned()

    seen = named(await read(gateway, "/v1/providers/prv_1/deliveries", gateway.provider))

    assert seen == set(AFTERWARDS)


@pytest.mark.parametrize(("caller", "expected"), [("customer", set()), ("operator", AFTERWARDS)])
async def test_the_answer_to_a_cancellation_is_for_its_caller(
    gateway: Gateway, caller: str, expected: Any
) -> None:
    delivery_id = await gateway.planned()

    answer = await gateway.http.post(
        f"/v1/deliveries/{delivery_id}/cancel", json={}, headers=getattr(gateway, caller)
    )

    assert answer.status_code == 200, answer.text
    assert named(answer.text) == set(expected)


async def test_events_name_nothing_that_comes_after_the_delivery(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()

    seen = [json.dumps(each) for each in await gateway.events(delivery_id)]

    assert len(seen) >= 2
    assert [name for name in AFTERWARDS for each in seen if f'"{name}"' in each] == []


async def test_what_customers_do_not_see_is_still_stored(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    await gateway.get(delivery_id)

    plan = json.loads(await read(gateway, f"/v1/deliveries/{delivery_id}/plan", gateway.operator))

    [mission] = plan["missions"]
    assert mission["home_plan"]["stats"] == {"labels": 3}
    assert mission["plan"]["stats"] == {"strategy": "exact", "labels": 7}
