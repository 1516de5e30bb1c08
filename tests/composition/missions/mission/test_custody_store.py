from typing import Any

import pytest
from skyway_composition.missions.mission.custody_store import (
    Custodian,
    Held,
    LiveCustody,
    carried_by,
    delivered,
    held_packages,
    may_load,
    on_board,
)
from skyway_composition.missions.mission.store import get

from skyway.ids import DeliveryId, DroneId, MissionId, PackageId

P1, P2 = PackageId("p1"), PackageId("p2")
DRONE = Custodian("DRONE", "drn_1")
RECIPIENT = Custodian("RECIPIENT", "c")


def test_a_drone_loads_what_a_station_has() -> None:
    assert may_load(Held(P1, 1, Custodian("STATION", "a")))


@pytest.mark.parametrize("has_it", [DRONE, Custodian("DRONE", "drn_2"), RECIPIENT])
def test_a_drone_loads_nothing_from_a_drone_or_a_recipient(has_it: Custodian) -> None:
    assert not may_load(Held(P1, 2, has_it))


def test_what_one_drone_carries_differs_from_what_others_carry() -> None:
    held = {P1: Held(P1, 2, DRONE), P2: Held(P2, 2, Custodian("DRONE", "drn_2"))}

    assert carried_by(held, DroneId("drn_1")) == frozenset({P1})


def test_packages_on_board_and_delivered_packages_are_distinguished() -> None:
    held = {P1: Held(P1, 2, DRONE), P2: Held(P2, 3, RECIPIENT)}

    assert on_board(held) == frozenset({P1})
    assert delivered(held) == frozenset({P2})


async def test_the_custody_of_live_missions_is_that_of_the_database_after_each_change(
    composition: Any,
) -> None:
    await composition.book()
    async with composition.db.write() as tx:
        record = await get(tx.connection, MissionId("msn_000001"), provider_id=None)
        assert record is not None
        live = LiveCustody(tx, record.delivery_ids)
        assert {each.seq for each in (await live.held_on(record)).values()} == {1}

        for seq, custodian in ((2, DRONE), (3, RECIPIENT)):
            rows = [Held(each.package_id, seq, custodian) for each in record.request.packages]
            await live.add(record, rows, at_ms=0)

            stored = await held_packages(tx.connection, DeliveryId("dlv_1"))
            assert await live.held_on(record) == stored
            assert {each.custodian for each in stored.values()} == {custodian}
