"""Copies a flown delivery and a drone as often as a size says, in the databases of a folder."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import asyncpg
from skyway_composition.tables import (
    custody,
    deliveries,
    drone_links,
    instructions,
    mission_steps,
    missions,
)
from skyway_gateway import delivery_tables as of_gateway
from skyway_gateway.tables import events
from skyway_lab.benchmarks.growth.copies import copy_id, copying, part_id
from skyway_lab.benchmarks.growth.sizes import Size
from skyway_provider_registry.tables import drones, presence
from sqlalchemy import Table, text

from skyway.cli.data_folder import DataFolder
from skyway.cli.system.databases import database_urls
from skyway.errors import SkywayError
from skyway.runtime.sql.database import Database

#: A delivery that one mission has flown.
_FLOWN: Final = text(
    "SELECT delivery_id, max(mission_id) AS mission_id, max(drone_id) AS drone_id FROM missions"
    " WHERE delivery_id IN (SELECT delivery_id FROM deliveries WHERE state = 'COMPLETED')"
    " GROUP BY delivery_id HAVING count(*) = 1 AND max(state) = 'COMPLETED'"
    " ORDER BY delivery_id LIMIT 1"
)
_FLEET: Final = text("SELECT drone_id FROM drones ORDER BY drone_id")

#: The most copies that one statement makes.
_TOGETHER: Final = 5_000

#: Customers take turns too.
_CUSTOMERS: Final = 5


@dataclass(frozen=True, slots=True)
class Copying:
    """What is copied, how often, and the drones that take turns."""

    delivery_id: str
    mission_id: str
    drone_id: str
    copies: int
    drone_ids: Sequence[str]

    def of(self, table: Table, key: str, **columns: str) -> Iterator[str]:
        """The statements that copy the rows of a table; `key` names a field of ours."""
        for numbers in _parts(self.copies):
            yield copying(
                table,
                where=f"old.{key} = '{getattr(self, key)}'",
                numbers=numbers,
                copies=self.copies,
                ids={
                    self.delivery_id: copy_id("dlv"),
                    self.mission_id: copy_id("msn"),
                    self.drone_id: "fleet.drone_id",
                },
                columns=columns,
                drone_ids=self.drone_ids,
            )


def _parts(copies: int) -> Iterator[range]:
    """The numbers of all copies, in parts that a statement makes within its deadline."""
    for first in range(1, copies + 1, _TOGETHER):
        yield range(first, min(first + _TOGETHER, copies + 1))


async def seed(folder: DataFolder, size: Size, *, fleet: int) -> None:
    """Copy rows until the databases have grown to this size; no service runs meanwhile.

    The past deliveries were flown by the first `fleet` drones in turn, as those that come later.
    """
    urls = await database_urls(folder)
    async with (
        Database(urls["gateway"]) as gateway,
        Database(urls["composition"]) as composition,
        Database(urls["registry"]) as registry,
    ):
        async with gateway.read() as connection:
            flown = (await connection.execute(_FLOWN)).one_or_none()
        async with registry.read() as connection:
            drone_ids = (await connection.execute(_FLEET)).scalars().all()[:fleet]
        if flown is None:
            raise SkywayError("no delivery was completed that could be copied")
        copied = flown.delivery_id, flown.mission_id, flown.drone_id
        past = Copying(*copied, copies=size.deliveries, drone_ids=drone_ids)
        await _run(gateway, _of_gateway(past))
        await _run(composition, _of_composition(past))
        await _run(registry, _idle_drones(drone_ids[0], size.drones, drones, presence))
        await _run(composition, _idle_drones(drone_ids[0], size.drones, drone_links))
    for url in urls.values():
        await _clean_up(url)


async def _run(db: Database, statements: Iterable[str]) -> None:
    for statement in statements:
        async with db.write() as tx:
            await tx.connection.exec_driver_sql(statement)


async def _clean_up(url: str) -> None:
    """Do what autovacuum does in a database that grows by itself; later it would be our cost."""
    if url.startswith("postgresql:"):
        connection = await asyncpg.connect(url)
        try:
            for statement in ("VACUUM ANALYZE", "CHECKPOINT"):
                await connection.execute(statement)
        finally:
            await connection.close()


def _of_gateway(past: Copying) -> Iterator[str]:
    yield from past.of(
        of_gateway.deliveries, "delivery_id", customer_id=f"'c' || CAST(n.i % {_CUSTOMERS} AS TEXT)"
    )
    for table in (of_gateway.packages, of_gateway.custody, of_gateway.missions):
        yield from past.of(table, "delivery_id")
    yield from past.of(events, "delivery_id", event_id=part_id("evt", "sequence"))


def _of_composition(past: Copying) -> Iterator[str]:
    yield from past.of(deliveries, "delivery_id")
    yield from past.of(missions, "mission_id")
    yield from past.of(mission_steps, "mission_id")
    yield from past.of(custody, "delivery_id")
    # Each copy has a stream of its own: a stream has no number twice.
    place = {"instruction_id": part_id("ins", "seq"), "stream": "1000 + n.i"}
    yield from past.of(instructions, "mission_id", **place)


def _idle_drones(drone_id: str, copies: int, *tables: Table) -> Iterator[str]:
    for table in tables:
        for numbers in _parts(copies):
            yield copying(
                table,
                where=f"old.drone_id = '{drone_id}'",
                numbers=numbers,
                copies=copies,
                ids={drone_id: copy_id("drn")},
                columns={},
                drone_ids=[drone_id],
            )
