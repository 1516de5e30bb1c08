"""The dispatcher moves what waits, and every calendar stays whole."""

import asyncio
import shutil
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from skyway_composition.closures.closure import Area
from skyway_composition.links.store import lock_links
from skyway_composition.missions.interventions import cancel
from skyway_composition.missions.interventions.stop_packages import release_queued
from skyway_composition.missions.queue.dispatching.adopt import BetterOrder, adopt
from skyway_composition.missions.queue.dispatching.search_process import (
    FoundOrder,
    Search,
    SearchFailed,
)
from skyway_composition.tables import drone_links, stations
from skyway_provider_registry.presence.store import store_reports
from skyway_provider_registry.tables import drones, mission_hints, presence, providers
from sqlalchemy import select, update

from skyway.delivery.plan import Fly, Plan, Recharge
from skyway.dispatch.problem import FleetDrone
from skyway.drone.learned_values import LearnedValues
from skyway.ids import PackageId
from skyway.network.network import Network
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from tests.composition.busy_network import NETWORK_ID
from tests.composition.busy_world import BusyWorld
from tests.composition.dispatched_world import (
    PROVIDER,
    OwnSearch,
    adopt_after_kills,
    better_order,
    dispatch_fairly,
    dispatcher_of,
    forecast_wind,
    waiting_missions,
)
from tests.composition.missions.queue.booked_chain import (
    book,
    delivered_by,
    etas,
    reports_of,
    request,
)
from tests.row_locks import free_keys, until_a_lock_is_waited_for

_on_sqlite = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

_AROUND_C = Area.model_validate(
    {
        "type": "Polygon",
        "coordinates": [[[0.05, 0.09], [0.06, 0.09], [0.054, 0.1], [0.05, 0.09]]],
    }
)

_ALL = [f"dlv{number}" for number in range(1, 6)]


async def book_unevenly(world: BusyWorld) -> None:
    """Four missions for the first drone, and one for the second."""
    for number in range(1, 5):
        assert await book(world, f"dlv{number}", "a", "b", drone=1) == "BOOKED"
    assert await book(world, "dlv5", "b", "c", drone=2) == "BOOKED"


class NotedSearch(OwnSearch):
    """Notes the drones of the last search."""

    drones: tuple[FleetDrone, ...] = ()

    async def find(self, search: Search, network: Network) -> FoundOrder:
        self.drones = search.fields["drones"]
        return await super().find(search, network)


class FailsOnce(OwnSearch):
    """Fails at first."""

    has_failed = False

    async def find(self, search: Search, network: Network) -> FoundOrder:
        if not self.has_failed:
            self.has_failed = True
            raise SearchFailed("for this test")
        return await super().find(search, network)


def batteries_of(plan: Plan | None, *, soc: float) -> Iterator[float]:
    """The energy of a full battery by each flight of a plan, which begins with this charge."""
    for step in () if plan is None else plan.steps:
        if isinstance(step, Fly):
            yield step.energy_j / (soc - step.soc_end)
        if isinstance(step, Fly | Recharge):
            soc = step.soc_end


@_on_sqlite
async def test_a_mission_moves_to_a_drone_that_delivers_it_sooner(world: BusyWorld) -> None:
    await book_unevenly(world)
    before = await etas(world)

    outcomes = await dispatch_fairly(world)

    assert outcomes[0] == "adopted"
    assert (await etas(world))["dlv3"] < before["dlv3"]
    (report,) = [each for each in await reports_of(world, "dlv3") if each.kind == "REPLANNED"]
    assert (report.drone_id, report.drone_before) == ("drn_2", "drn_1")
    assert report.mission is not None
    assert report.mission.drone_id == "drn_2"
    await world.end()
    assert sorted(delivered_by(world, 1) + delivered_by(world, 2)) == _ALL
    assert "dlv3" in delivered_by(world, 2)


@pytest.fixture
def registry_url(tmp_path: Path, templates: Any) -> str:
    """The URL of a new database of the registry."""
    path = tmp_path / "registry.db"
    shutil.copy(templates.on_sqlite("skyway_provider_registry"), path)
    return f"sqlite:///{path}"


async def register(registry: Database, drone_ids: list[str]) -> None:
    """Add drones of the provider that have sent nothing yet."""
    order = ("connection_session", "connection_number", "connection_rank")
    none = dict.fromkeys((*order, "state_session", "state_seq", "sample_session", "sample_seq"), -1)
    home = {"home_station_id": "a", "home_longitude_deg": 0, "home_latitude_deg": 0}
    names = {"provider_id": PROVIDER, "model_id": "m", "network_id": "row"}
    drone = {**names, **home, "initial_soc": 1}
    terms = {"name": "P", "tariff": "{}", "state": "ACTIVE"}
    async with registry.write() as tx:
        await tx.execute(providers.insert().values(provider_id=PROVIDER, **terms, created_ms=0))
        for drone_id in drone_ids:
            about = {"drone_id": drone_id}
            new = drones.insert().values(**about, **drone, is_in_maintenance=False, created_ms=0)
            await tx.execute(new)
            await tx.execute(presence.insert().values(**about, **none))


@_on_sqlite
async def test_the_registry_learns_which_drone_a_moved_mission_has(
    world: BusyWorld, registry_url: str
) -> None:
    await book_unevenly(world)
    await dispatch_fairly(world)
    (moved,) = [each for each in await reports_of(world, "dlv3") if each.kind == "REPLANNED"]

    async with Database(registry_url) as registry:
        await register(registry, ["drn_1", "drn_2"])
        for report in await world.reports("registry"):
            async with registry.write() as tx:
                await store_reports(tx, [report], wall_at=world.clock.wall_now())
        async with registry.read() as connection:
            found = await connection.execute(
                select(mission_hints).where(mission_hints.c.mission_id == moved.mission_id)
            )
            hint = found.one()

    assert moved.free_from is not None
    assert (hint.drone_id, hint.free_station_id, hint.mission_state) == (
        "drn_2",
        moved.free_from.station_id,
        "QUEUED",
    )


@_on_sqlite
async def test_a_mission_that_moves_is_planned_with_what_its_new_drone_has_learned(
    world: BusyWorld,
) -> None:
    first, second, *_ = world.drones
    first.learned = LearnedValues(still_air_factor=1.1)
    second.learned = LearnedValues(state_of_health=0.9)
    await book_unevenly(world)
    search = NotedSearch()

    assert await dispatcher_of(world, search=search).look_at(NETWORK_ID, PROVIDER) == "adopted"

    assert len({each.model.battery_j for each in search.drones}) == 2
    records = (await waiting_missions(world)).values()
    assert {each.drone_id: each.candidate.learned for each in records} == {
        each.drone_id: each.learned for each in (first, second)
    }
    for each in records:
        batteries = [
            *batteries_of(each.mission.plan, soc=each.start.soc),
            *batteries_of(each.mission.home_plan, soc=each.stays[0].soc_from),
        ]
        planned_j = each.candidate.planned_model.battery_j
        assert batteries == pytest.approx([planned_j] * len(batteries))
    await world.check()


@_on_sqlite
@pytest.mark.parametrize("from_deg", [90.0, 270.0], ids=["head wind", "tail wind"])
async def test_an_order_is_judged_and_adopted_with_its_plans_in_the_forecast(
    world: BusyWorld, from_deg: float
) -> None:
    await forecast_wind(world, speed_mps=5.0, from_deg=from_deg)
    await book_unevenly(world)
    dispatcher, before = dispatcher_of(world), await waiting_missions(world)

    better = await better_order(dispatcher)
    assert await dispatcher.adopt(better) == "adopted"

    after = await waiting_missions(world)
    ends = [
        [one.mission.packages[0].eta_at for _, one in sorted(each.items())]
        for each in (before, after)
    ]
    saved_s = sum((old - new).total_seconds() for old, new in zip(*ends, strict=True))
    assert better.judged().saved_s == pytest.approx(saved_s, abs=0.1)
    for record in after.values():
        assert record.mission.weather is not None
        flights = [each for each in record.mission.plan.steps if isinstance(each, Fly)]
        assert {each.time_factor for each in flights} != {1.0}
    await world.check()


@_on_sqlite
async def test_a_promise_that_only_a_tail_wind_keeps_does_not_end_the_search(
    world: BusyWorld,
) -> None:
    await forecast_wind(world, speed_mps=5.0, from_deg=270.0)
    later = world.clock.now() + timedelta(minutes=20)
    assert await book(world, "dlv9", "c", "b", drone=4, earliest_pickup_at=later) == "BOOKED"
    await book_unevenly(world)

    assert (await dispatch_fairly(world, tolerance_s=0.0))[0] == "adopted"


@_on_sqlite
@pytest.mark.parametrize("is_due", [False, True])
async def test_a_drone_out_of_service_or_due_for_maintenance_gets_no_mission(
    world: BusyWorld, is_due: bool
) -> None:
    await book_unevenly(world)
    away = frozenset({"drn_2"})
    dispatcher = dispatcher_of(world, due=away) if is_due else dispatcher_of(world, withdrawn=away)

    assert await dispatcher.look_at(NETWORK_ID, PROVIDER) != "adopted"

    assert {each.drone_id for each in (await waiting_missions(world)).values()} == {"drn_1"}


@_on_sqlite
async def test_calendars_are_searched_four_times_in_vain_and_again_after_a_change(
    world: BusyWorld,
) -> None:
    await book(world, "dlv1", "a", "b")
    await book(world, "dlv2", "b", "c")
    await book(world, "dlv3", "c", "a")
    dispatcher = dispatcher_of(world)

    outcomes = [await dispatcher.look_at(NETWORK_ID, PROVIDER) for _ in range(5)]
    await book(world, "dlv4", "a", "b")
    after_change = await dispatcher.look_at(NETWORK_ID, PROVIDER)

    assert outcomes == ["kept", "kept", "kept", "kept", "unsearched"]
    assert after_change != "unsearched"


@_on_sqlite
async def test_a_drone_that_a_ground_stop_holds_gets_no_mission(world: BusyWorld) -> None:
    # The second drone ends its first mission there.
    await world.close("GROUND_STOP", area=_AROUND_C)
    await book_unevenly(world)

    assert await dispatcher_of(world).look_at(NETWORK_ID, PROVIDER) != "adopted"

    assert {each.drone_id for each in (await waiting_missions(world)).values()} == {"drn_1"}


@_on_sqlite
async def test_a_fleet_whose_search_has_failed_is_searched_again(world: BusyWorld) -> None:
    await book_unevenly(world)
    dispatcher = dispatcher_of(world, search=FailsOnce())

    outcomes = [await dispatcher.look_at(NETWORK_ID, PROVIDER) for _ in range(2)]

    assert outcomes == ["failed", "adopted"]


@_on_sqlite
async def test_planning_stops_when_its_order_comes_too_late(world: BusyWorld) -> None:
    await book_unevenly(world)
    before = await waiting_missions(world)

    class Late(OwnSearch):
        async def find(self, search: Search, network: Network) -> FoundOrder:
            found = await super().find(search, network)
            world.clock.advance(timedelta(hours=1))
            return found

    dispatcher = dispatcher_of(world, search=Late())

    assert await dispatcher.look_at(NETWORK_ID, PROVIDER) == "no plan now"

    assert await waiting_missions(world) == before


@_on_sqlite
async def test_an_order_whose_calendars_have_changed_meanwhile_is_not_adopted(
    world: BusyWorld,
) -> None:
    await book_unevenly(world)
    one, other = dispatcher_of(world), dispatcher_of(world)
    orders = [await better_order(one), await better_order(other)]

    # As when two replicas lead for a moment.
    outcomes = [await one.adopt(orders[0]), await other.adopt(orders[1])]
    assert outcomes == ["adopted", "outdated"]
    await world.check()

    again = dispatcher_of(world, tolerance_s=3_600.0)
    found = await again.finder.find(NETWORK_ID, PROVIDER)
    await world.cancel("dlv4", None)
    if isinstance(found, BetterOrder):
        assert await again.adopt(found) == "outdated"
    await world.check()
    await world.end()


@_on_sqlite
async def test_an_order_for_a_drone_that_is_held_for_a_customer_meanwhile_is_not_adopted(
    world: BusyWorld,
) -> None:
    """The held offer counts on the calendar that the drone has now."""
    await book_unevenly(world)
    dispatcher = dispatcher_of(world)
    found = await better_order(dispatcher)
    async with world.db.write() as tx:
        until_ms = moment_to_ms(world.clock.now()) + 60_000
        held = {"held_by": "hld_1", "held_until_ms": until_ms, "calendar_version": 99}
        await tx.execute(update(drone_links).values(**held))

    assert await dispatcher.adopt(found) == "outdated"


@pytest.mark.long
@pytest.mark.databases("postgresql")
async def test_an_adoption_that_is_killed_anywhere_changes_nothing(world: BusyWorld) -> None:
    """On PostgreSQL, where each statement is a wait."""
    await book_unevenly(world)
    dispatcher = dispatcher_of(world)

    await adopt_after_kills(world, dispatcher, await better_order(dispatcher))

    await world.end()
    assert sorted(delivered_by(world, 1) + delivered_by(world, 2)) == _ALL


@pytest.mark.databases("postgresql")
async def test_a_cancellation_locks_the_drone_to_which_its_mission_has_just_moved(
    world: BusyWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On PostgreSQL, where two transactions write at the same time."""
    await book_unevenly(world)
    better = await better_order(dispatcher_of(world))
    before = await waiting_missions(world)
    moved = next(
        each.record
        for missions in better.moved.values()
        for each in missions
        if each.record.drone_id != before[each.record.mission_id].drone_id
    )
    locked: list[bool] = []

    async def noted(*asked: Any, **how: Any) -> tuple[PackageId, ...]:
        locked.append(moved.drone_id not in await free_keys(world.db, "drone_links", "drone_id"))
        return await release_queued(*asked, **how)

    monkeypatch.setattr(cancel, "release_queued", noted)
    async with world.db.write() as tx:
        await lock_links(tx, [*better.moved])
        cancelling = asyncio.create_task(world.cancel(moved.mission.delivery_id, None))
        await until_a_lock_is_waited_for(world.db)
        await adopt(world.context, tx, better)

    assert (await cancelling).released == (f"{moved.mission.delivery_id}_1",)
    assert locked == [True]
    await world.check()


@pytest.mark.parametrize("migrated_url", ["postgresql"], indirect=True)
async def test_an_adoption_locks_the_stations_of_all_its_missions_before_it_moves_any(
    world: BusyWorld,
) -> None:
    """The first drone's mission needs no pad at a, and the second drone's does."""
    assert await book(world, "dlv1", "b", "c", drone=3) == "BOOKED"
    assert await book(world, "dlv2", "c", "a", drone=4) == "BOOKED"
    assert await book(world, "dlv3", "a", "b", "c", drone=3) == "BOOKED"
    assert await book(world, "dlv4", "c", "b", drone=3) == "BOOKED"
    dispatcher = dispatcher_of(world)
    better = await better_order(dispatcher)

    async with world.db.write() as tx:
        await tx.execute(select(stations).where(stations.c.station_id == "a").with_for_update())
        adopting = asyncio.create_task(dispatcher.adopt(better))
        await until_a_lock_is_waited_for(world.db)
        free = await free_keys(world.db, "stations", "station_id")

    assert await adopting == "adopted"
    assert free == {"b", "c"}


@pytest.mark.databases("postgresql")
async def test_bookings_go_on_while_orders_are_adopted(migrated_url: str) -> None:
    """On both databases, neither a booking nor an adoption leaves half a calendar."""
    async with BusyWorld(migrated_url) as world:
        await book_unevenly(world)
        dispatcher = dispatcher_of(world)

        async def dispatch() -> list[str]:
            return [await dispatcher.look_at(NETWORK_ID, PROVIDER) for _ in range(4)]

        async def customer(number: int) -> str:
            asked = request(f"dlv{number}", "a", "b")
            return await world.book(f"dlv{number}", asked, loading="AUTOMATIC")

        outcomes, *booked = await asyncio.gather(dispatch(), *map(customer, range(10, 18)))

        await world.check()
        assert "adopted" in outcomes or "outdated" in outcomes or "taken" in outcomes
        assert set(booked) <= {"BOOKED", "BUSY"}
