"""What becomes of a mission after a drone of another provider got it."""

from datetime import timedelta
from typing import Any, Final

import pytest
from skyway_composition.missions.interventions.withdraw import withdraw_missions
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.queue.keep_calendars import WithdrawnDrones

from skyway.contracts.mission import WithdrawMissions
from skyway.contracts.mission_reports import MissionReport
from skyway.delivery.offer import Tariff
from skyway.ids import DeliveryId
from tests.composition.busy_world import BusyWorld
from tests.composition.dispatched_world import (
    RegistryInService,
    dispatcher_of,
    look,
    waiting_missions,
)
from tests.composition.missions.queue.booked_chain import delivered_by, reports_of, request
from tests.composition.missions.queue.dispatching.test_exchange import (
    AGREED,
    SAME,
    TwoProviders,
    book_unevenly,
)

pytestmark = pytest.mark.databases("sqlite")

#: Cheaper than the tariff with which everything is booked, and dearer.
_CHEAP: Final = Tariff(base=1, per_km=1)
_DEAR: Final = Tariff(base=900, per_km=90)


@pytest.fixture
async def world(migrated_url: str) -> Any:
    async with TwoProviders(migrated_url) as world:
        yield world


async def exchanged(
    world: BusyWorld, tariff: Tariff = SAME, *, method: str | None = None
) -> list[MissionRecord]:
    """The missions that the second provider got from the first one, the first to begin first."""
    await book_unevenly(world, AGREED, method=method)
    before = await waiting_missions(world)
    registry = RegistryInService(tariffs={"prv_1": SAME, "prv_2": tariff})
    assert await look(world, dispatcher_of(world, registry=registry)) == ["adopted"]
    after = await waiting_missions(world)
    moved = [
        each
        for each in after.values()
        if (each.mission.provider_id, before[each.mission_id].mission.provider_id)
        == ("prv_2", "prv_1")
    ]
    assert moved
    return sorted(moved, key=lambda each: each.start.at_ms)


async def kinds_of(world: BusyWorld, record: MissionRecord) -> dict[str, MissionReport]:
    """The last report of each kind about a mission after its exchange; all are of drone 2."""
    every = await reports_of(world, record.mission.delivery_id)
    found = [each for each in every if each.mission_id == record.mission_id]
    after = found[[each.code for each in found].index("PROVIDER_CHANGED") :]
    assert {(each.provider_id, each.drone_id) for each in after} == {("prv_2", "drn_2")}
    return {each.kind: each for each in after}


async def until_live(world: BusyWorld, record: MissionRecord) -> None:
    """Let time pass until the mission has taken its packages on board."""
    while "LOADED" not in await kinds_of(world, record):
        await world.pass_time(timedelta(minutes=5))


@pytest.mark.parametrize("method", ["PIN", "PHOTO"])
async def test_the_drone_of_the_new_provider_waits_for_the_proof(
    world: BusyWorld, method: str
) -> None:
    record, *_ = await exchanged(world, method=method)

    await world.end()

    kinds = await kinds_of(world, record)
    assert {"PROOF_AWAITED", "DELIVERED"} <= {*kinds}
    assert str(record.mission.delivery_id) in delivered_by(world, 2)


async def test_without_the_proof_the_drone_of_the_new_provider_brings_the_package_back(
    world: BusyWorld,
) -> None:
    record, *_ = await exchanged(world, method="PIN")
    world.recipients = "ABSENT"

    await world.end()

    kinds = await kinds_of(world, record)
    assert "RETURNED" in kinds
    assert "DELIVERED" not in kinds


async def test_a_cancelled_package_in_flight_is_brought_back_by_the_new_provider(
    world: BusyWorld,
) -> None:
    record, *_ = await exchanged(world)
    await until_live(world, record)

    await world.cancel(record.mission.delivery_id, None)
    await world.end()

    assert "RETURNED" in await kinds_of(world, record)
    assert str(record.mission.delivery_id) not in delivered_by(world, 2)


async def test_a_changed_request_withdraws_the_mission_from_the_new_provider(
    world: BusyWorld,
) -> None:
    record, *_ = await exchanged(world)
    name = DeliveryId(record.mission.delivery_id)

    await withdraw_missions(world.context, name, WithdrawMissions(attempt=1))
    world.attempts[name] = 1
    again = request(name, "a", "c")
    assert await world.book(name, again, loading="AUTOMATIC", drones=world.drones[:1]) == "BOOKED"
    await world.end()

    assert (await kinds_of(world, record)).keys() >= {"REPLANNED", "REFUSED"}
    assert name in delivered_by(world, 1)
    assert name not in delivered_by(world, 2)


async def test_a_cheap_tariff_that_is_raised_later_changes_no_price(world: BusyWorld) -> None:
    """The agreed price is paid in any case; a dear provider gets no more deliveries."""
    moved = await exchanged(world, _CHEAP)
    of_both = {"prv_1": SAME, "prv_2": _DEAR}
    before = await waiting_missions(world)

    await look(world, dispatcher_of(world, registry=RegistryInService(tariffs=of_both)))

    after = await waiting_missions(world)
    assert {name: each.mission.price for name, each in after.items()} == {
        name: each.mission.price for name, each in before.items()
    }
    assert {each.candidate.tariff for each in after.values()} == {
        each.candidate.tariff for each in before.values()
    }
    of_second = {name for name, each in after.items() if each.mission.provider_id == "prv_2"}
    was_of_second = {name for name, each in before.items() if each.mission.provider_id == "prv_2"}
    assert of_second <= was_of_second
    assert {each.mission_id for each in moved} <= was_of_second


async def test_a_provider_that_is_suspended_after_an_exchange_gives_its_missions_up(
    world: BusyWorld,
) -> None:
    """As those that it was booked for: the gateway books them anew."""
    moved = await exchanged(world)
    suspended = RegistryInService(withdrawn=frozenset({"drn_2"}))

    while await WithdrawnDrones(world.context, suspended).step():  # type: ignore[arg-type]
        pass

    left = await waiting_missions(world)
    assert not {each.mission_id for each in moved} & left.keys()
    for each in moved:
        refused = (await kinds_of(world, each))["REFUSED"]
        assert refused.provider_id == "prv_2"
    await world.check()
