"""A waiting mission changes its provider only if its customer and both providers agree."""

from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, Final

import pytest
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.queue.dispatching.adopt import BetterOrder
from skyway_composition.missions.queue.dispatching.dispatch import Dispatcher
from skyway_composition.missions.queue.dispatching.fleet import Fleet
from skyway_composition.missions.queue.dispatching.merger import share_of
from skyway_composition.missions.queue.dispatching.search_process import FoundOrder, Search
from skyway_composition.statistics.store import better_orders_of

from skyway.delivery.offer import Tariff
from skyway.ids import DroneId, ProviderId
from skyway.network.network import Network
from skyway.runtime.sql.database import Tx
from tests.composition.busy_network import MODEL, NETWORK_ID, PLACES, add_network
from tests.composition.busy_world import BusyWorld
from tests.composition.dispatched_world import (
    OwnSearch,
    RegistryInService,
    adopt_after_kills,
    dispatcher_of,
    look,
    waiting_missions,
)
from tests.composition.flown_drone import FlownDrone
from tests.composition.missions.queue.booked_chain import delivered_by, reports_of, request

pytestmark = pytest.mark.databases("sqlite")

#: With this tariff the drones of a busy world are booked.
SAME: Final = Tariff(base=100, per_km=10)
_FIRST, _SECOND = ProviderId("prv_1"), ProviderId("prv_2")
AGREED: Final = {"may_change_provider": True}
_FIRST_DRONE, _WEAK = DroneId("drn_1"), DroneId("drn_weak")


class TwoProviders(BusyWorld):
    """A drone of each of two providers, in a network in which they may be planned together."""

    is_joint = True

    async def add_network(self, tx: Tx) -> None:
        await add_network(tx, now_ms=self.now_ms, settings={"joint_dispatch": self.is_joint})

    def make_drones(self) -> Iterator[FlownDrone]:
        for number, home in enumerate("aa", 1):
            yield FlownDrone(
                f"drn_{number}",
                model=MODEL,
                home=home,
                position=PLACES[home],
                clock=self.clock,
                provider_id=f"prv_{number}",
            )


class EachAlone(TwoProviders):
    """The same in a network in which each provider's drones are planned alone."""

    is_joint = False


class WithAWeakDrone(TwoProviders):
    """The second provider also has a drone that lifts nothing that the first one flies."""

    def make_drones(self) -> Iterator[FlownDrone]:
        yield from super().make_drones()
        yield FlownDrone(
            "drn_weak",
            model=MODEL.model_copy(update={"max_payload_kg": 0.3}),
            home="a",
            position=PLACES["a"],
            clock=self.clock,
            provider_id="prv_2",
        )


@pytest.fixture(params=[TwoProviders])
async def world(migrated_url: str, request: Any) -> AsyncIterator[BusyWorld]:
    async with request.param(migrated_url) as world:
        yield world


async def book_unevenly(
    world: BusyWorld,
    qos: Mapping[str, Any] = AGREED,
    *,
    loading: str = "AUTOMATIC",
    method: str | None = None,
) -> None:
    """Four missions for the drone of the first provider, and one for that of the second.

    The first four need this proof.
    """
    proof = None if method is None else {"method": method, "wait_s": 900}
    for number, (pickup, to, drone) in enumerate([*[("a", "b", 0)] * 4, ("b", "c", 1)], 1):
        outcome = await world.book(
            f"dlv{number}",
            request(f"dlv{number}", pickup, to, qos={**qos} if drone == 0 else {}, proof=proof),
            loading="AUTOMATIC" if drone == 0 else loading,
            drones=[world.drones[drone]],
        )
        assert outcome == "BOOKED"
        await world.keep_calendars()


def joint(world: BusyWorld, **tariffs: Tariff) -> Dispatcher:
    """A dispatcher; the providers that are named exchange deliveries, at these tariffs."""
    return dispatcher_of(world, registry=RegistryInService(tariffs=tariffs))


async def providers_of(world: BusyWorld) -> dict[str, str]:
    """The provider of each waiting delivery."""
    found = (await waiting_missions(world)).values()
    return {str(each.mission.delivery_id): each.mission.provider_id for each in found}


def agreed(records: Mapping[Any, MissionRecord]) -> dict[str, Any]:
    """What a customer has agreed to: price, terms and promise of each delivery."""
    return {
        str(each.mission.delivery_id): (
            each.mission.price,
            each.mission.payment_terms,
            each.candidate.tariff,
            each.promised,
        )
        for each in records.values()
    }


async def test_a_mission_changes_its_provider_if_all_three_agree(world: BusyWorld) -> None:
    await book_unevenly(world)
    before = await waiting_missions(world)

    assert await look(world, joint(world, prv_1=SAME, prv_2=SAME)) == ["adopted"]

    after = await waiting_missions(world)
    moved = [name for name, of in (await providers_of(world)).items() if of == "prv_2"]
    assert set(moved) & {"dlv2", "dlv3", "dlv4"}
    assert agreed(after) == agreed(before)
    for name in {*moved} - {"dlv5"}:
        (report,) = [each for each in await reports_of(world, name) if each.kind == "REPLANNED"]
        assert (report.code, report.drone_before) == ("PROVIDER_CHANGED", "drn_1")
        assert report.mission is not None
        assert (report.provider_id, report.mission.provider_id) == ("prv_2", "prv_2")
        assert "prv_1" not in report.model_dump_json()
    await world.end()
    assert {*moved} <= {*delivered_by(world, 2)}


class TooMuchForTheWeak(OwnSearch):
    """Adds a mission of the first drone to those of the weak one, which has no plan for it.

    So does a real search where wind is: it plans in still air.
    """

    async def find(self, search: Search, network: Network) -> FoundOrder:
        found = await super().find(search, network)
        orders = dict(found.orders)
        if _WEAK in orders:
            *first, last = orders[_FIRST_DRONE]
            orders |= {_FIRST_DRONE: tuple(first), _WEAK: (*orders[_WEAK], last)}
        return replace(found, orders=orders)


@pytest.mark.parametrize("world", [WithAWeakDrone], indirect=True)
async def test_a_drone_without_a_plan_does_not_refuse_the_order_of_all_others(
    world: BusyWorld,
) -> None:
    await book_unevenly(world)
    weak = world.drones[2:]
    light = request("dlv6", "a", "b")
    light = light.model_copy(
        update={
            "packages": tuple(one.model_copy(update={"mass_kg": 0.2}) for one in light.packages)
        }
    )
    for name in ("dlv6", "dlv7"):
        assert await world.book(name, light, loading="AUTOMATIC", drones=weak) == "BOOKED"
        await world.keep_calendars()
    dispatcher = dispatcher_of(
        world,
        search=TooMuchForTheWeak(),
        registry=RegistryInService(tariffs={"prv_1": SAME, "prv_2": SAME}),
    )

    assert await look(world, dispatcher) == ["adopted"]

    after = await waiting_missions(world)
    of_weak = {str(each.mission.delivery_id) for each in after.values() if each.drone_id == _WEAK}
    assert of_weak <= {"dlv6", "dlv7"}
    assert "drn_2" in {each.drone_id for each in after.values()}
    await world.end()


async def test_each_provider_counts_what_was_saved_for_its_own_missions(world: BusyWorld) -> None:
    await book_unevenly(world)

    await look(world, joint(world, prv_1=SAME, prv_2=SAME))

    async with world.db.read() as connection:
        found = await better_orders_of(connection, None, since_ms=0)
    assert {name: orders for name, (orders, _) in found.items()}[_FIRST] == 1
    assert found[_FIRST][1] > 60_000


@pytest.mark.parametrize(
    ("qos", "tariffs"),
    [
        ({}, {"prv_1": SAME, "prv_2": SAME}),
        (AGREED, {"prv_1": SAME}),
        (AGREED, {"prv_2": SAME}),
        (AGREED, {"prv_1": SAME, "prv_2": Tariff(base=100, per_km=11)}),
        (AGREED, {"prv_1": SAME, "prv_2": SAME.model_copy(update={"currency": "EUR"})}),
        (AGREED | {"providers": {"denied": ["prv_2"]}}, {"prv_1": SAME, "prv_2": SAME}),
        (AGREED | {"providers": {"pinned": "prv_1"}}, {"prv_1": SAME, "prv_2": SAME}),
        (AGREED | {"pooling": True}, {"prv_1": SAME, "prv_2": SAME}),
    ],
    ids=[
        "the customer does not allow it",
        "the other provider does not exchange",
        "the own provider does not exchange",
        "the other tariff asks for more",
        "the other tariff has another currency",
        "the customer denies the other provider",
        "the customer wants one provider only",
        "the mission may share a trip",
    ],
)
async def test_a_mission_keeps_its_provider_if(
    world: BusyWorld, qos: dict[str, Any], tariffs: dict[str, Tariff]
) -> None:
    await book_unevenly(world, qos)
    before = await providers_of(world)

    await look(world, joint(world, **tariffs))

    after = await providers_of(world)
    assert after == {name: before[name] for name in after}


async def test_a_mission_keeps_its_provider_if_the_other_one_loads_otherwise(
    world: BusyWorld,
) -> None:
    await book_unevenly(world, loading="CONFIRMED")
    before = await providers_of(world)

    await look(world, joint(world, prv_1=SAME, prv_2=SAME))

    assert await providers_of(world) == before


@pytest.mark.parametrize("world", [EachAlone], indirect=True)
async def test_a_mission_keeps_its_provider_if_the_network_does_not_allow_it(
    world: BusyWorld,
) -> None:
    await book_unevenly(world)
    before, dispatcher = await providers_of(world), joint(world, prv_1=SAME, prv_2=SAME)

    assert await dispatcher.finder.fleets() == [(NETWORK_ID, _FIRST)]
    await look(world, dispatcher)

    assert await providers_of(world) == before


async def test_a_mission_that_flies_for_several_deliveries_keeps_its_provider(
    world: BusyWorld,
) -> None:
    await book_unevenly(world)
    skyway = await world.context.networks.current(NETWORK_ID)
    fleet = Fleet({}, {_FIRST: SAME, _SECOND: SAME})
    [of_second] = [each for each in await world.planned() if each.drone_id == "drn_2"]
    record, *_ = (await waiting_missions(world)).values()
    shared = replace(record, shares=(share_of(record),))

    may = [
        fleet.may_fly(each, of_second.candidate, each.mission.plan, network=skyway.network)
        for each in (record, shared)
    ]

    assert may == [True, False]


async def test_providers_are_searched_alone_if_together_too_many_missions_wait(
    world: BusyWorld,
) -> None:
    await book_unevenly(world)
    finder = joint(world, prv_1=SAME, prv_2=SAME).finder

    assert await finder.fleets() == [(NETWORK_ID, _FIRST, _SECOND)]
    assert await replace(finder, most_together=2).fleets() == [(NETWORK_ID, _FIRST)]


async def found_by(dispatcher: Dispatcher) -> BetterOrder:
    found = await dispatcher.finder.find(NETWORK_ID, _FIRST, _SECOND)
    assert isinstance(found, BetterOrder)
    assert found.has_exchanges
    return found


@pytest.mark.parametrize(
    "change",
    [
        lambda tariffs: tariffs.pop(_SECOND),
        lambda tariffs: tariffs.update({_SECOND: Tariff(base=900)}),
    ],
    ids=["a provider has withdrawn its rule", "a tariff has changed"],
)
async def test_an_order_is_not_adopted_if_meanwhile(
    world: BusyWorld, change: Callable[[dict[ProviderId, Tariff]], object]
) -> None:
    await book_unevenly(world)
    registry = RegistryInService(tariffs={"prv_1": SAME, "prv_2": SAME})
    dispatcher, before = dispatcher_of(world, registry=registry), await waiting_missions(world)
    better = await found_by(dispatcher)

    change(registry.tariffs)

    assert await dispatcher.adopt(better) == "outdated"
    assert await waiting_missions(world) == before


async def test_of_two_leaders_one_moves_a_mission_to_another_provider(world: BusyWorld) -> None:
    await book_unevenly(world)
    leaders = [joint(world, prv_1=SAME, prv_2=SAME) for _ in range(2)]
    orders = [await found_by(each) for each in leaders]

    outcomes = [await leader.adopt(each) for leader, each in zip(leaders, orders, strict=True)]

    assert outcomes == ["adopted", "outdated"]
    await world.check()


@pytest.mark.long
@pytest.mark.databases("postgresql")
async def test_an_exchange_that_is_killed_anywhere_changes_nothing(world: BusyWorld) -> None:
    """On PostgreSQL, where each statement is a wait."""
    await book_unevenly(world)
    dispatcher = joint(world, prv_1=SAME, prv_2=SAME)

    await adopt_after_kills(world, dispatcher, await found_by(dispatcher))

    assert "prv_2" in {of for name, of in (await providers_of(world)).items() if name != "dlv5"}


async def book_for_first(world: BusyWorld, qos: Mapping[str, Any] = AGREED) -> None:
    """Two missions for the drone of the first provider; the second one waits for the drone."""
    for name in ("dlv1", "dlv2"):
        asked = request(name, "a", "b", qos={**qos})
        drones = world.drones[:1]
        assert await world.book(name, asked, loading="AUTOMATIC", drones=drones) == "BOOKED"
        await world.keep_calendars()


def with_an_idle_drone(world: BusyWorld, *, loading: str = "AUTOMATIC") -> Dispatcher:
    """A dispatcher; both providers exchange deliveries, and the drone of the second is idle."""
    registry = RegistryInService(
        tariffs={"prv_1": SAME, "prv_2": SAME}, able=world.drones[1:], loading=loading
    )
    return dispatcher_of(world, registry=registry)


async def test_a_mission_moves_to_an_idle_drone_of_a_provider_without_missions(
    world: BusyWorld,
) -> None:
    await book_for_first(world)

    assert await look(world, with_an_idle_drone(world)) == ["adopted"]

    assert await providers_of(world) == {"dlv2": "prv_2"}
    await world.end()
    assert delivered_by(world, 2) == ["dlv2"]


@pytest.mark.parametrize(
    ("qos", "loading"),
    [
        ({}, "AUTOMATIC"),
        (AGREED | {"providers": {"denied": ["prv_2"]}}, "AUTOMATIC"),
        (AGREED, "CONFIRMED"),
    ],
    ids=["the customer does not allow it", "the customer denies it", "it loads otherwise"],
)
async def test_an_idle_drone_of_another_provider_gets_no_mission_if(
    world: BusyWorld, qos: dict[str, Any], loading: str
) -> None:
    await book_for_first(world, qos)

    await look(world, with_an_idle_drone(world, loading=loading))

    assert await providers_of(world) == {"dlv2": "prv_1"}
