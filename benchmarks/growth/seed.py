"""Copies a flown delivery and a drone as often as a size says, in the databases of a folder."""

from collections.abc import Sequence
from typing import Final

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
from skyway_provider_registry.tables import drones, presence
from sqlalchemy import Table, text

from benchmarks.growth.copies import copy_id, copying, part_id
from benchmarks.growth.sizes import Size
from skyway.cli.data_folder import DataFolder
from skyway.cli.system.databases import database_urls
from skyway.errors import SkywayError
from skyway.runtime.sql.database import Database

#: A delivery that one mission has flown.
_FLOWN: Final = text(
    "SELECT delivery_id, max(mission_id) AS mission_id FROM missions WHERE delivery_id IN"
    " (SELECT delivery_id FROM deliveries WHERE state = 'COMPLETED')"
    " GROUP BY delivery_id HAVING count(*) = 1 ORDER BY delivery_id LIMIT 1"
)
_A_DRONE: Final = text("SELECT min(drone_id) FROM drones")


async def seed(folder: DataFolder, size: Size) -> None:
    """Copy rows until the databases have grown to this size; no service runs meanwhile."""
    urls = await database_urls(folder)
    async with Database(urls["gateway"]) as gateway, Database(urls["registry"]) as registry:
        async with gateway.read() as connection:
            flown = (await connection.execute(_FLOWN)).one_or_none()
        async with registry.read() as connection:
            drone_id = (await connection.execute(_A_DRONE)).scalar_one()
        if flown is None:
            raise SkywayError("no delivery was completed that could be copied")
        delivery = flown.delivery_id, flown.mission_id
        await _run(gateway, _of_gateway(*delivery, copies=size.deliveries))
        await _run(registry, _drones(drone_id, copies=size.drones))
    async with Database(urls["composition"]) as composition:
        await _run(composition, _of_composition(*delivery, copies=size.deliveries))
        await _run(composition, _links(drone_id, copies=size.drones))


async def _run(db: Database, statements: Sequence[str]) -> None:
    for statement in statements:
        async with db.write() as tx:
            await tx.connection.exec_driver_sql(statement)
    if db.dialect == "postgresql":
        # As autovacuum does in a database that has grown by itself.
        async with db.write() as tx:
            await tx.connection.exec_driver_sql("ANALYZE")


def _ids(delivery_id: str, mission_id: str) -> dict[str, str]:
    return {delivery_id: copy_id("dlv"), mission_id: copy_id("msn")}


def _of_gateway(delivery_id: str, mission_id: str, *, copies: int) -> list[str]:
    tables = of_gateway.deliveries, of_gateway.packages, of_gateway.custody, of_gateway.missions
    event_id = {"event_id": part_id("evt", "sequence")}
    return [
        copying(
            table,
            where=f"old.delivery_id = '{delivery_id}'",
            copies=copies,
            ids=_ids(delivery_id, mission_id),
            columns=event_id if table is events else {},
        )
        for table in (*tables, events)
    ]


def _of_composition(delivery_id: str, mission_id: str, *, copies: int) -> list[str]:
    #: Each copy has a stream of its own: a stream has no number twice.
    instruction = {"instruction_id": part_id("ins", "seq"), "stream": "1000 + n.i"}
    return [
        copying(
            table,
            where=f"old.{key} = '{value}'",
            copies=copies,
            ids=_ids(delivery_id, mission_id),
            columns=instruction if table is instructions else {},
        )
        for table, key, value in (
            (deliveries, "delivery_id", delivery_id),
            (missions, "mission_id", mission_id),
            (mission_steps, "mission_id", mission_id),
            (custody, "delivery_id", delivery_id),
            (instructions, "mission_id", mission_id),
        )
    ]


def _drones(drone_id: str, *, copies: int) -> list[str]:
    return [_of_drone(table, drone_id, copies) for table in (drones, presence)]


def _links(drone_id: str, *, copies: int) -> list[str]:
    return [_of_drone(drone_links, drone_id, copies)]


def _of_drone(table: Table, drone_id: str, copies: int) -> str:
    return copying(
        table,
        where=f"old.drone_id = '{drone_id}'",
        copies=copies,
        ids={drone_id: copy_id("drn")},
        columns={},
    )
