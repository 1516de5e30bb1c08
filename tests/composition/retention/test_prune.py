"""Closures that are over and acknowledged alarms are deleted after the days of the settings."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.retention.prune import Pruning

from tests.composition.conftest import make_network

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


async def publish_versions(composition: Any, count: int) -> None:
    """Publish further versions of the network, one a day; each has one pad more at a station."""
    for number in range(count):
        composition.clock.advance(DAY)
        await composition.publish(make_network(pads={"e": 3 + number}))


async def kept_versions(composition: Any) -> list[int]:
    found = await composition.rows("SELECT version FROM network_versions ORDER BY version")
    return [row[0] for row in found]


def version_pruning(composition: Any, *, kept: timedelta) -> Pruning:
    return Pruning(composition.db, composition.clock, None, None, versions_kept=kept)


async def prune_all(pruning: Pruning) -> None:
    while await pruning.step():
        pass


async def test_versions_are_deleted_after_a_newer_one_has_replaced_them_for_long(
    composition: Any,
) -> None:
    await publish_versions(composition, 30)
    composition.clock.advance(DAY / 2)

    await prune_all(version_pruning(composition, kept=2 * DAY))

    # Version 31 is current since half a day, 30 since a day and a half, 29 since longer.
    assert await kept_versions(composition) == [29, 30, 31]
    assert await composition.broken() == []
    path = "/v1/networks/row"
    assert (await composition(OPERATOR, "GET", f"{path}?version=28")).status_code == 404
    assert (await composition(OPERATOR, "GET", f"{path}?version=29")).status_code == 200


async def test_the_current_version_stays_however_old_it_is(composition: Any) -> None:
    composition.clock.advance(400 * DAY)

    await prune_all(version_pruning(composition, kept=DAY))

    assert await kept_versions(composition) == [1]


@pytest.mark.parametrize(
    ("state", "kept"), [("QUEUED", [3, 4, 5, 6]), ("CANCELLED", [5, 6])], ids=str
)
async def test_versions_stay_while_a_mission_waits_that_was_planned_with_one(
    composition: Any, state: str, kept: list[int]
) -> None:
    await composition.book()
    await publish_versions(composition, 5)
    async with composition.db.write() as tx:
        planned = f"UPDATE missions SET planned_version = 3, state = '{state}'"
        await tx.connection.exec_driver_sql(planned)

    await prune_all(version_pruning(composition, kept=DAY))

    assert await kept_versions(composition) == kept
