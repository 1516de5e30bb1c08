"""Idle drones that repeat their states: nothing is written, and no change is missed."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.links.store import link_to
from skyway_composition.tables import outbox

from skyway.contracts.drone_report import DroneState
from skyway.ids import DroneId
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.mqtt.client import Received
from skyway.runtime.sql.database import Database, Tx

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

MINUTE = timedelta(minutes=1)


class FarDatabase(Database):
    """A database that commits, but may lose the connection before it answers."""

    goes_away = False

    @asynccontextmanager
    async def write(self) -> AsyncIterator[Tx]:
        async with super().write() as tx:
            yield tx
        if self.goes_away:
            raise ServiceUnavailable("database", "the connection was lost")


async def kept_state(composition: Any) -> DroneState:
    async with composition.db.read() as connection:
        link = await link_to(connection, DroneId("drn_1"))
    assert link is not None
    assert link.state is not None
    return link.state


async def said(composition: Any, drone: Any, **members: Any) -> Received[Any]:
    """A state of the drone, a minute after the state before."""
    composition.clock.advance(MINUTE)
    state: Received[Any] = drone.state(**members)
    await composition.receive(state)
    return state


@pytest.fixture
def idle(drone: Any) -> Any:
    """A drone that never got an instruction."""
    drone.stream = 0
    return drone


async def test_only_the_first_of_equal_states_is_saved(composition: Any, idle: Any) -> None:
    first = await said(composition, idle)

    await said(composition, idle)
    await said(composition, idle, soc=0.995)

    assert await kept_state(composition) == first.message


@pytest.mark.parametrize(
    "news",
    [
        {"station_id": "b"},
        {"station_id": None},
        {"activity": "DOWN"},
        {"activity": "RECHARGING"},
        {"soc": 0.98},
        {"mission_id": "msn_9"},
        {"last_event_seq": 1},
        {"stream": 1},
        {"is_held": True},
        {"faults": ("BATTERY_WORN",)},
        {"package_ids": ("p9",)},
        {"session": 2, "seq": 1},
    ],
)
async def test_every_change_of_a_state_is_saved(
    composition: Any, idle: Any, news: dict[str, object]
) -> None:
    await said(composition, idle)
    await said(composition, idle)

    changed = await said(composition, idle, **news)

    assert await kept_state(composition) == changed.message


async def test_slowly_falling_charge_is_saved(composition: Any, idle: Any) -> None:
    for soc in (1.0, 0.996, 0.992, 0.988):
        last = await said(composition, idle, soc=soc)

    assert await kept_state(composition) == last.message


async def test_an_equal_state_is_saved_every_five_minutes(composition: Any, idle: Any) -> None:
    states = [await said(composition, idle) for _ in range(7)]

    assert await kept_state(composition) == states[5].message


async def test_a_state_older_than_a_repeated_state_changes_nothing(
    composition: Any, idle: Any
) -> None:
    first = await said(composition, idle)
    late = idle.state(station_id="b")
    await said(composition, idle)

    await composition.receive(late)

    assert await kept_state(composition) == first.message


async def test_a_drone_that_reports_idle_after_the_expiry_does_not_fly(
    composition: Any, idle: Any
) -> None:
    await said(composition, idle)
    await said(composition, idle)
    await composition.book()

    for _ in range(3):
        await said(composition, idle)
        await composition.overdue.step()

    (report,) = await composition.reports()
    assert (report.kind, report.code) == ("REFUSED", "NO_ANSWER")


async def test_a_repeated_state_shows_a_lost_journal_after_a_late_answer(
    composition: Any, drone: Any
) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    answer = drone.ack(instruction, "REJECTED", code="MALFORMED")
    drone.session, drone.stream = 2, 0
    await said(composition, drone)

    await composition.receive(answer)
    await said(composition, drone)

    links = await composition.rows("SELECT stream FROM drone_links")
    assert [row.stream for row in links] == [2]


async def test_repeated_connections_change_nothing(composition: Any, idle: Any) -> None:
    await composition.receive(idle.connection("ONLINE", 1), idle.connection("ONLINE", 2))

    await composition.receive(idle.connection("LOST", 1))
    await composition.receive(idle.connection("ONLINE", 2))
    links = await composition.rows("SELECT connection FROM drone_links")

    assert '"connection_number":2,"status":"ONLINE"' in links[0].connection
    await composition.receive(idle.connection("LOST", 2))
    links = await composition.rows("SELECT connection FROM drone_links")
    assert '"connection_number":2,"status":"LOST"' in links[0].connection


async def test_after_a_lost_commit_answer_an_earlier_state_is_saved_again(
    composition: Any, idle: Any, migrated_url: str
) -> None:
    async with FarDatabase(migrated_url, outbox=outbox) as far:
        handler = replace(composition.parts, db=far).handler
        await handler.handle([idle.state(station_id="a")])
        far.goes_away = True
        with pytest.raises(ServiceUnavailable):
            await handler.handle([idle.state(station_id="b")])
        far.goes_away = False

        await handler.handle([idle.state(station_id="a")])

    assert (await kept_state(composition)).station_id == "a"
