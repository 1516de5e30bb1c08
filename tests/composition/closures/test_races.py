"""I11: once a closure is answered, no plan that breaks it can be booked, even in a close race.

A mission that is booked before the closure is replanned. A booking after the closure avoids it.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Any

import pytest
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.step_store import steps_of
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.flight_step import FlyStep
from skyway.contracts.mission import BookMissions
from skyway.contracts.shortlist import Shortlist
from skyway.ids import DeliveryId
from skyway.runtime.sql.database import Database, Tx

OPERATOR = "operator:op"
AROUND_B = [[0.15, -0.1], [0.2, -0.1], [0.2, 0.1], [0.15, 0.1], [0.15, -0.1]]

#: How to make each closure, and which flights it forbids.
CLOSINGS: dict[str, tuple[str, Any, Callable[[FlyStep], bool]]] = {
    "station": ("/v1/stations/b/closures", {}, lambda step: step.lands and step.to_id == "b"),
    "segment": (
        "/v1/segments/b/c/closures",
        {},
        lambda step: (step.from_id, step.to_id) == ("b", "c"),
    ),
    "zone": (
        "/v1/zones",
        {"network_id": "row", "area": {"type": "Polygon", "coordinates": [AROUND_B]}},
        lambda step: "b" in (step.from_id, step.to_id),
    ),
}


class Meddling(Database):
    """A database that calls a function just before every transaction."""

    def __init__(self, db: Database, meddle: Callable[[], Awaitable[None]]) -> None:
        self._db = db
        self._meddle = meddle

    @asynccontextmanager
    async def read(self) -> AsyncIterator[AsyncConnection]:
        async with self._db.read() as connection:
            yield connection

    @asynccontextmanager
    async def write(self) -> AsyncIterator[Tx]:
        await self._meddle()
        async with self._db.write() as tx:
            yield tx


async def unaware(composition: Any, is_forbidden: Callable[[FlyStep], bool]) -> list[str]:
    """The live missions with a forbidden flight that are not being replanned."""
    async with composition.db.read() as connection:
        records = await store.page(connection, store.MissionFilter(), before=None, limit=100)
        return [
            record.mission_id
            for record in records
            if record.is_live and record.trouble is None
            for each in await steps_of(connection, record.mission_id)
            if isinstance(each.step, FlyStep) and is_forbidden(each.step)
        ]


@pytest.mark.parametrize("what", CLOSINGS)
async def test_a_plan_made_before_a_closure_is_not_booked_after_it(
    composition: Any, make: Any, what: str
) -> None:
    path, body, is_forbidden = CLOSINGS[what]
    closed: list[int] = []

    async def close_once() -> None:
        if not closed:
            closed.append((await composition(OPERATOR, "POST", path, body)).status_code)

    parts = replace(composition.parts, db=Meddling(composition.db, close_once))
    requested = BookMissions(
        attempt=1, request=make.request("c"), shortlist=Shortlist.of([make.candidate()])
    )

    booking = await parts.bookings.book(DeliveryId("dlv_1"), requested)

    assert closed == [201]
    assert booking.outcome != "BOOKED"
    assert await unaware(composition, is_forbidden) == []


async def test_bookings_that_race_with_closures_avoid_them_or_are_replanned(
    composition: Any, make: Any
) -> None:
    path, _, is_forbidden = CLOSINGS["station"]

    async def open_and_close() -> None:
        for _ in range(4):
            made = (await composition(OPERATOR, "POST", path)).json()
            await composition(OPERATOR, "DELETE", f"{path}/{made['closure_id']}")
        assert (await composition(OPERATOR, "POST", path)).status_code == 201

    await asyncio.gather(
        open_and_close(),
        *(
            composition.book(make.candidate(number), delivery_id=f"dlv_{number}")
            for number in range(1, 9)
        ),
    )

    assert await unaware(composition, is_forbidden) == []
    assert await composition.broken() == []


async def test_a_plan_made_before_an_outage_is_not_booked_after_it(
    composition: Any, make: Any
) -> None:
    closed: list[int] = []

    async def fail_once() -> None:
        if not closed:
            answer = await composition(OPERATOR, "POST", "/v1/stations/b/pads/0/outages")
            closed.append(answer.status_code)

    parts = replace(composition.parts, db=Meddling(composition.db, fail_once))
    requested = BookMissions(
        attempt=1, request=make.request("c"), shortlist=Shortlist.of([make.candidate()])
    )

    booking = await parts.bookings.book(DeliveryId("dlv_1"), requested)

    assert booking.outcome == "BOOKED"
    held = {(row.station_id, row.pad) for row in await composition.reservations()}
    assert ("b", 1) in held
    assert ("b", 0) not in held


async def test_a_reopened_station_is_used_again(composition: Any) -> None:
    made = await composition(OPERATOR, "POST", "/v1/stations/b/closures")
    closed = await composition.book()

    await composition(OPERATOR, "DELETE", f"/v1/stations/b/closures/{made.json()['closure_id']}")
    reopened = await composition.book(attempt=2)

    assert closed.outcome != "BOOKED"
    assert reopened.outcome == "BOOKED"
