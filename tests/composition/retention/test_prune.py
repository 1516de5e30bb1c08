"""Closures that are over and acknowledged alarms are deleted after the days of the settings."""

from datetime import timedelta
from typing import Any

from skyway_composition.retention.prune import Pruning

DAY = timedelta(days=1)
OPERATOR = "operator:op"


def pruning(composition: Any) -> Pruning:
    return Pruning(composition.db, composition.clock, closures_kept=DAY, alarms_kept=DAY)


async def close(composition: Any, station_id: str, **members: Any) -> str:
    """The id of a new closure of a station."""
    answer = await composition(
        OPERATOR, "POST", f"/v1/stations/{station_id}/closures", {"reason": "storm", **members}
    )
    assert answer.is_success, answer.text
    return str(answer.json()["closure_id"])


async def lift(composition: Any, station_id: str, closure_id: str) -> None:
    path = f"/v1/stations/{station_id}/closures/{closure_id}"
    assert (await composition(OPERATOR, "DELETE", path)).is_success


async def closure_ids(composition: Any) -> set[str]:
    return {row[0] for row in await composition.rows("SELECT closure_id FROM closures")}


async def test_closures_are_deleted_after_their_end(composition: Any) -> None:
    until = (composition.clock.now() + timedelta(hours=1)).isoformat()
    lifted = await close(composition, "b")
    await lift(composition, "b", lifted)
    await close(composition, "b", until=until)
    lasting = await close(composition, "c")
    composition.clock.advance(2 * DAY)
    fresh = await close(composition, "b")
    await lift(composition, "b", fresh)

    assert await pruning(composition).step() is False

    assert await closure_ids(composition) == {lasting, fresh}
    assert await composition.broken() == []


async def alarm(composition: Any, alarm_id: str, mission_id: str | None = None) -> None:
    """An acknowledged alarm."""
    now_ms = int(composition.clock.now().timestamp() * 1000)
    named = "NULL" if mission_id is None else f"'{mission_id}'"
    async with composition.db.write() as tx:
        await tx.connection.exec_driver_sql(
            "INSERT INTO alarms (alarm_id, level, code, detail, at_ms, mission_id, data,"
            f" acknowledged_ms) VALUES ('{alarm_id}', 'WARNING', 'ANY', '', {now_ms}, {named},"
            f" '{{}}', {now_ms})"
        )


async def test_alarms_are_deleted_after_their_acknowledgement(composition: Any) -> None:
    booking = await composition.book()
    await alarm(composition, "alm_old")
    await alarm(composition, "alm_of_open_mission", booking.missions[0].mission_id)
    async with composition.db.write() as tx:
        await tx.connection.exec_driver_sql(
            "INSERT INTO alarms (alarm_id, level, code, detail, at_ms, data)"
            " VALUES ('alm_open', 'WARNING', 'ANY', '', 1, '{}')"
        )
    composition.clock.advance(2 * DAY)
    await alarm(composition, "alm_new")

    await pruning(composition).step()

    left = {row[0] for row in await composition.rows("SELECT alarm_id FROM alarms")}
    assert left == {"alm_of_open_mission", "alm_open", "alm_new"}


async def test_nothing_is_deleted_without_a_setting(composition: Any) -> None:
    lifted = await close(composition, "b")
    await lift(composition, "b", lifted)
    composition.clock.advance(400 * DAY)

    await Pruning(composition.db, composition.clock, None, None).step()

    assert await closure_ids(composition) == {lifted}
