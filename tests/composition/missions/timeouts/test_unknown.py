"""Operators learn within 30 s of missions that the gateway does not know, and when that is over."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.gauges import CompositionGauges
from skyway_composition.missions.timeouts import UnknownMissions
from sqlalchemy import text

from skyway.runtime.metrics import Gauges
from skyway.units import moment_to_ms

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

FIRST_LOOK = timedelta(seconds=15)


async def looking(composition: Any) -> UnknownMissions:
    """The loop's work, after its first seconds."""
    unknown = UnknownMissions(composition.parts)
    await unknown.step()
    composition.clock.advance(FIRST_LOOK)
    return unknown


async def accepted(composition: Any, drone: Any, *, delivery_id: str = "dlv_1") -> None:
    """A mission whose first report waits for the gateway, stored now."""
    await composition.book(delivery_id=delivery_id)
    [instruction] = await composition.sent()
    await composition.receive(drone.ack(instruction))
    now_ms = moment_to_ms(composition.clock.wall_now())
    async with composition.db.write() as tx:
        await tx.execute(text("UPDATE outbox SET stored_wall_ms = :now"), {"now": now_ms})


async def alarms(composition: Any, state: str = "OPEN") -> list[Any]:
    path = f"/v1/alarms?state={state}"
    items = (await composition("operator:op", "GET", path)).json()["items"]
    return [each for each in items if each["code"] == "MISSIONS_UNKNOWN"]


async def shown(composition: Any) -> float:
    gauges = Gauges()
    gauges.show(*CompositionGauges(composition.parts).sources())
    return next(
        each.value for each in await gauges.read() if each.name == "skyway_unknown_missions"
    )


async def reports_leave(composition: Any) -> None:
    async with composition.db.write() as tx:
        await tx.execute(text("DELETE FROM outbox WHERE channel = 'gateway'"))


async def test_an_alarm_is_raised_within_thirty_seconds(composition: Any, drone: Any) -> None:
    unknown = await looking(composition)
    await accepted(composition, drone)
    for _ in range(5):  # the loop looks every 5 s
        composition.clock.advance(timedelta(seconds=5))
        await unknown.step()

    [alarm] = await alarms(composition)
    assert alarm["level"] == "CRITICAL"
    assert "1 missions" in alarm["detail"]
    assert await shown(composition) == 1


async def test_a_report_on_its_way_raises_no_alarm(composition: Any, drone: Any) -> None:
    unknown = await looking(composition)
    await accepted(composition, drone)
    composition.clock.advance(timedelta(seconds=10))
    await unknown.step()

    assert await alarms(composition) == []
    assert await shown(composition) == 0


async def test_the_alarm_ends_when_the_gateway_knows_the_missions(
    composition: Any, drone: Any
) -> None:
    unknown = await looking(composition)
    await accepted(composition, drone)
    composition.clock.advance(timedelta(seconds=20))
    await unknown.step()
    await reports_leave(composition)
    await unknown.step()

    assert await alarms(composition) == []
    [ended] = await alarms(composition, "ACKNOWLEDGED")
    assert (ended["acknowledged_by"], ended["note"]) == (
        "service:composition",
        "this is over; the alarm has ended by itself",
    )


async def test_an_alarm_of_the_process_before_ends_too(composition: Any, drone: Any) -> None:
    unknown = await looking(composition)
    await accepted(composition, drone)
    composition.clock.advance(timedelta(seconds=20))
    await unknown.step()
    await reports_leave(composition)

    await (await looking(composition)).step()
    assert await alarms(composition) == []


async def test_an_acknowledged_alarm_is_not_raised_again(composition: Any, drone: Any) -> None:
    unknown = await looking(composition)
    await accepted(composition, drone)
    composition.clock.advance(timedelta(seconds=20))
    await unknown.step()
    [alarm] = await alarms(composition)
    path = f"/v1/alarms/{alarm['alarm_id']}/acknowledgements"
    await composition("operator:op", "POST", path, {})
    await unknown.step()

    assert await alarms(composition) == []


async def test_reports_that_waited_through_a_stop_raise_no_alarm(
    composition: Any, drone: Any
) -> None:
    await accepted(composition, drone)
    composition.clock.advance(timedelta(hours=9))
    unknown = UnknownMissions(composition.parts)
    await unknown.step()

    assert await alarms(composition) == []


async def test_a_mission_whose_first_report_has_left_is_known(composition: Any, drone: Any) -> None:
    unknown = await looking(composition)
    await accepted(composition, drone)
    async with composition.db.write() as tx:
        later = text("UPDATE outbox SET payload = replace(payload, :one, :two)")
        await tx.execute(later, {"one": '"seq":1', "two": '"seq":2'})
    composition.clock.advance(timedelta(seconds=20))
    await unknown.step()

    assert await alarms(composition) == []
