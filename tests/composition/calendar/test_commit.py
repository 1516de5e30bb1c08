"""A world still holds until its network is published again, closed or reopened."""

from datetime import timedelta
from typing import Any

import numpy as np
from skyway_composition.calendar.commit import Snapshot, WorldChanged, lock_as_seen
from skyway_composition.links.link import DroneLink
from skyway_composition.links.store import links_to
from skyway_composition.planning.world import World

from skyway.ids import DroneId
from tests.composition.missions.booking.test_holds import quote

OPERATOR = "operator:op"
FAR_AWAY = {"type": "Polygon", "coordinates": [[[90, 0], [91, 0], [91, 1], [90, 0]]]}


async def look(composition: Any, **members: Any) -> World:
    networks = composition.parts.networks
    present = await networks.present("row")
    return await World.at(present, networks, db=composition.db, after_ms=0, **members)


async def holds(composition: Any, world: World) -> bool:
    async with composition.db.write() as tx:
        try:
            await lock_as_seen(tx, Snapshot(world.present, {}))
        except WorldChanged:
            return False
    return True


async def test_a_world_holds_while_nothing_changes(composition: Any) -> None:
    world = await look(composition)

    # The database itself checks reservations.
    await composition.book()

    assert await holds(composition, world)


async def test_a_world_no_longer_holds_after_a_closure_or_its_lifting(composition: Any) -> None:
    before = await look(composition)
    made = await composition(OPERATOR, "POST", "/v1/stations/e/closures")
    during = await look(composition)
    is_known = await holds(composition, during)
    await composition(OPERATOR, "DELETE", f"/v1/stations/e/closures/{made.json()['closure_id']}")

    assert is_known
    assert not await holds(composition, before)
    assert not await holds(composition, during)
    assert await holds(composition, await look(composition))


async def test_no_world_holds_after_a_ground_stop_everywhere(composition: Any) -> None:
    world = await look(composition)

    await composition(OPERATOR, "POST", "/v1/ground-stops", {"reason": "storm"})

    assert not await holds(composition, world)


async def test_a_world_still_holds_after_a_closure_in_another_network(
    composition: Any, make: Any
) -> None:
    await composition(OPERATOR, "PUT", "/v1/networks/other", make.network(stations="xy"))
    world = await look(composition)

    await composition(OPERATOR, "POST", "/v1/stations/x/closures")
    await composition(OPERATOR, "POST", "/v1/zones", {"network_id": "other", "area": FAR_AWAY})

    assert await holds(composition, world)


async def test_a_world_no_longer_holds_after_a_new_version(composition: Any, make: Any) -> None:
    world = await look(composition)

    await composition.publish(make.network(loading_s=1))

    assert not await holds(composition, world)


async def test_the_gap_between_drones_is_the_networks_unless_given(
    composition: Any, make: Any
) -> None:
    await composition.publish(make.network(pad_gap_s=60))
    await composition.book()
    exact = await look(composition, pad_gap_s=0.0)
    world = await look(composition)

    for each in (exact, world):
        await each.pads.read(np.arange(5, dtype=np.int32))

    assert (world.pads.book.start_ms == exact.pads.book.start_ms - 60_000).all()
    assert len(world.pads.book.start_ms) > 0


async def test_a_plan_from_a_step_falls_when_the_drone_goes_on(
    composition: Any, drone: Any
) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    doing = {"mission_id": instruction.mission_id, "mission_revision": 1}
    await composition.receive(drone.ack(instruction), drone.state(step_id=1, **doing))
    world, drone_id = await look(composition), DroneId("drn_1")
    [link] = (await links_of(composition, drone_id)).values()
    seen = Snapshot(world.present, {drone_id: link.calendar_version}, {drone_id: link.at_step})

    async def is_as_seen() -> bool:
        async with composition.db.write() as tx:
            try:
                await lock_as_seen(tx, seen)
            except WorldChanged:
                return False
        return True

    assert await is_as_seen()
    await composition.receive(drone.state(step_id=2, **doing))
    [now] = (await links_of(composition, drone_id)).values()

    assert now.calendar_version == link.calendar_version
    assert not await is_as_seen()


async def links_of(composition: Any, drone_id: DroneId) -> dict[DroneId, DroneLink]:
    async with composition.db.read() as connection:
        return await links_to(connection, [drone_id])


async def test_a_hold_and_its_end_raise_the_number_of_the_calendar(
    composition: Any, make: Any
) -> None:
    await composition.book()

    async def number() -> int:
        [row] = await composition.rows("SELECT calendar_version FROM drone_links")
        return int(row.calendar_version)

    before = await number()
    await quote(composition, make)
    held = await number()
    composition.clock.advance(timedelta(hours=1))
    await composition.parts.keeper.delete_expired()

    assert before < held < await number()
