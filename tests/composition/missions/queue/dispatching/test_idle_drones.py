"""A waiting mission moves to an idle drone that a booking would find now."""

from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest
from skyway_composition.links.store import link_to
from skyway_composition.missions.queue.dispatching.fleet import (
    Fleet,
    Moments,
    calendar_of,
    free_to_take_off,
)
from skyway_composition.planning.world import World
from skyway_composition.tables import drone_links
from sqlalchemy import update

from skyway.ids import StationId
from tests.composition.busy_network import MODEL, NETWORK_ID, PLACES
from tests.composition.busy_world import BusyWorld
from tests.composition.dispatched_world import (
    PROVIDER,
    RegistryInService,
    better_order,
    dispatcher_of,
    look,
    waiting_missions,
)
from tests.composition.flown_drone import FlownDrone
from tests.composition.missions.queue.booked_chain import (
    book,
    delivered_by,
    etas,
    reports_of,
)

pytestmark = pytest.mark.databases("sqlite")


class Beside(BusyWorld):
    """Two drones of one provider that stand at the same station."""

    model = MODEL

    def make_drones(self) -> Iterator[FlownDrone]:
        for number, model in ((1, MODEL), (2, self.model)):
            yield FlownDrone(
                f"drn_{number}", model=model, home="a", position=PLACES["a"], clock=self.clock
            )


class BesideAWeakDrone(Beside):
    """The second drone lifts no package of these tests."""

    model = MODEL.model_copy(update={"max_payload_kg": 0.3})


@pytest.fixture(params=[Beside])
async def world(migrated_url: str, request: Any) -> AsyncIterator[BusyWorld]:
    async with request.param(migrated_url) as world:
        yield world


async def book_on_first(world: BusyWorld, missions: int = 2, **qos: Any) -> None:
    """Book the first drone for so many missions from "a"; the first one is sent."""
    for number in range(1, missions + 1):
        assert await book(world, f"dlv{number}", "a", "b", qos=qos) == "BOOKED"


def able(world: BusyWorld, **members: Any) -> RegistryInService:
    """A registry that names all drones except the first, which is busy."""
    return RegistryInService(able=world.drones[1:], **members)


async def drones_of(world: BusyWorld) -> dict[str, str]:
    """The drone of each waiting delivery."""
    found = (await waiting_missions(world)).values()
    return {str(each.mission.delivery_id): each.drone_id for each in found}


async def test_a_mission_that_waits_for_its_drone_moves_to_the_idle_one_beside_it(
    world: BusyWorld,
) -> None:
    await book_on_first(world)
    before = await etas(world)

    assert await look(world, dispatcher_of(world, registry=able(world))) == ["adopted"]

    assert await drones_of(world) == {"dlv2": "drn_2"}
    assert (await etas(world))["dlv2"] < before["dlv2"]
    (report,) = [each for each in await reports_of(world, "dlv2") if each.kind == "REPLANNED"]
    assert (report.drone_id, report.drone_before) == ("drn_2", "drn_1")
    await world.end()
    assert (delivered_by(world, 1), delivered_by(world, 2)) == (["dlv1"], ["dlv2"])


async def test_an_idle_drone_gets_one_mission_of_a_long_queue_at_least(world: BusyWorld) -> None:
    await book_on_first(world, missions=5)

    await look(world, dispatcher_of(world, registry=able(world)))

    assert {*(await drones_of(world)).values()} == {"drn_1", "drn_2"}
    await world.end()


@pytest.mark.parametrize("world", [BesideAWeakDrone], indirect=True)
async def test_a_mission_stays_if_the_idle_drone_cannot_carry_it(world: BusyWorld) -> None:
    await book_on_first(world)

    await look(world, dispatcher_of(world, registry=able(world)))

    assert await drones_of(world) == {"dlv2": "drn_1"}


async def hold(world: BusyWorld) -> None:
    async with world.db.write() as tx:
        held = {"held_by": "hld_1", "held_until_ms": world.now_ms + 60_000}
        await tx.execute(update(drone_links).where(drone_links.c.drone_id == "drn_2").values(held))


async def disconnect(world: BusyWorld) -> None:
    world.drones[1].set_reception(False)
    await world.converse()


async def book_it(world: BusyWorld) -> None:
    assert await book(world, "dlv9", "b", "c", drone=2) == "BOOKED"


@pytest.mark.parametrize(
    "change",
    [hold, disconnect],
    ids=["it is held for a customer's offer", "its connection is lost"],
)
async def test_a_mission_stays_although_the_registry_names_a_drone_if(
    world: BusyWorld, change: Callable[[BusyWorld], Awaitable[None]]
) -> None:
    await book_on_first(world)
    await change(world)

    # No `look`: the rows that this test writes by hand break rules.
    dispatcher = dispatcher_of(world, registry=able(world))
    assert await dispatcher.look_at(NETWORK_ID, PROVIDER) == "unsearched"


async def test_an_order_is_not_adopted_if_its_idle_drone_was_booked_meanwhile(
    world: BusyWorld,
) -> None:
    await book_on_first(world, missions=3)
    dispatcher = dispatcher_of(world, registry=able(world))
    order = await better_order(dispatcher)

    await book_it(world)

    assert await dispatcher.adopt(order) == "outdated"
    await look(world, dispatcher)
    await world.end()


async def test_of_two_leaders_one_moves_a_mission_to_an_idle_drone(world: BusyWorld) -> None:
    await book_on_first(world)
    leaders = [dispatcher_of(world, registry=able(world)) for _ in range(2)]
    orders = [await better_order(each) for each in leaders]

    outcomes = [await leader.adopt(each) for leader, each in zip(leaders, orders, strict=True)]

    assert outcomes == ["adopted", "outdated"]
    await world.check()


async def test_drones_with_missions_are_planned_if_the_registry_names_no_candidates(
    world: BusyWorld,
) -> None:
    await book_on_first(world, missions=4)
    await book_it(world)
    registry = RegistryInService(able=None)

    assert await look(world, dispatcher_of(world, registry=registry)) == ["adopted"]

    assert len(registry.asked) == 1
    assert "drn_2" in {drone for name, drone in (await drones_of(world)).items() if name != "dlv9"}


async def test_the_registry_is_asked_once_about_all_that_waits_alike(world: BusyWorld) -> None:
    await book_on_first(world, missions=4)
    assert await book(world, "dlv5", "b", "a") == "BOOKED"
    registry = able(world)

    await look(world, dispatcher_of(world, registry=registry))

    [asked] = registry.asked
    pickups = [each.pickup_station_id for each in asked.queries]
    assert sorted(pickups) == ["a", "b"]
    assert {each.providers.pinned for each in asked.queries} == {"prv_1"}


@pytest.mark.parametrize(
    ("state", "is_able"),
    [({}, True), ({"soc": 0.01}, False), ({"station_id": StationId("z")}, False)],
    ids=["charged", "below its reserve", "at a station of another network"],
)
async def test_one_idle_drone_that_cannot_begin_does_not_spoil_the_search_of_all(
    world: BusyWorld, state: dict[str, Any], is_able: bool
) -> None:
    idle = world.drones[1]
    async with world.db.read() as connection:
        link = await link_to(connection, idle.drone_id)
    assert link is not None
    assert link.state is not None
    link = replace(link, state=link.state.model_copy(update=state))
    times = Moments(world.now_ms, world.now_ms, 60_000)
    calendar = calendar_of(idle.candidate(), link, version=1, times=times)
    assert calendar is not None
    skyway = await world.context.networks.current(NETWORK_ID)
    present = await World.of(skyway, world.db, after_ms=world.now_ms)

    able = free_to_take_off(Fleet({idle.drone_id: calendar}), present, times)

    assert [*able.calendars] == ([idle.drone_id] if is_able else [])
