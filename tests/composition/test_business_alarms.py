"""The registry names all settings that get no deliveries: alarms begin and end accordingly."""

from datetime import timedelta
from typing import Any

import pytest

from skyway.contracts.business_faults import BUSINESS_FAULTS

pytestmark = pytest.mark.databases("sqlite")

REGISTRY = {"Authorization": "Bearer secret of registry"}
FAULT = {
    "provider_id": "prv_1",
    "network_id": "corridor",
    "code": "OTHER_CURRENCY",
    "detail": "the network has other prices: set another tariff",
}


async def report(composition: Any, *faults: dict[str, str]) -> None:
    answer = await composition(None, "POST", BUSINESS_FAULTS, {"faults": faults}, **REGISTRY)
    assert answer.status_code == 204, answer.text


async def alarms_of(composition: Any, caller: str = "operator:op", state: str = "OPEN") -> Any:
    answer = await composition(caller, "GET", f"/v1/alarms?state={state}")
    return answer.json()["items"]


async def test_a_fault_that_is_reported_again_and_again_is_one_alarm_for_its_provider(
    composition: Any,
) -> None:
    await report(composition, FAULT)
    await report(composition, FAULT, {**FAULT, "provider_id": "prv_2"})

    assert len(await alarms_of(composition)) == 2
    (own,) = await alarms_of(composition, "provider:prv_1")
    assert (own["level"], own["code"], own["detail"]) == (
        "WARNING",
        "OTHER_CURRENCY",
        FAULT["detail"],
    )
    assert own["data"] == {"network_id": "corridor"}


async def test_an_alarm_ends_when_its_fault_is_not_named_any_more_and_begins_again(
    composition: Any,
) -> None:
    other = {**FAULT, "code": "OTHER_CONNECTOR"}
    await report(composition, FAULT, other)

    await report(composition, other)

    (left,) = await alarms_of(composition)
    (ended,) = await alarms_of(composition, state="ACKNOWLEDGED")
    assert (left["code"], ended["code"]) == ("OTHER_CONNECTOR", "OTHER_CURRENCY")
    assert ended["acknowledged_by"] == "service:composition"
    await report(composition, FAULT, other)
    assert len(await alarms_of(composition)) == 2


async def test_an_operator_who_acknowledged_a_fault_is_reminded_after_a_day(
    composition: Any,
) -> None:
    await report(composition, FAULT)
    (alarm,) = await alarms_of(composition)
    path = f"/v1/alarms/{alarm['alarm_id']}/acknowledgements"
    await composition("operator:op", "POST", path, {})

    composition.clock.advance(timedelta(hours=23))
    await report(composition, FAULT)
    within_a_day = await alarms_of(composition)
    composition.clock.advance(timedelta(hours=2))
    await report(composition, FAULT)

    assert within_a_day == []
    assert len(await alarms_of(composition)) == 1


async def test_alarms_that_drones_raise_under_these_codes_stay(composition: Any) -> None:
    alarm = {
        "provider_id": "prv_1",
        "drone_id": "drn_1",
        "level": "WARNING",
        "code": "OTHER_CURRENCY",
        "detail": "of a drone",
        "at": "2026-03-01T12:00:00Z",
    }
    await composition(None, "POST", "/internal/drone-alarms", alarm, **REGISTRY)

    await report(composition)

    assert [each["drone_id"] for each in await alarms_of(composition)] == ["drn_1"]
