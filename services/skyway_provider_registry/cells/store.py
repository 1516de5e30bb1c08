"""All SQL of the table of cells."""

from collections.abc import Collection
from datetime import datetime
from typing import Final

from sqlalchemy import func, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.cells import NetworkCell
from skyway.ids import NetworkId
from skyway.runtime.errors import Conflict
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_provider_registry.tables import cells

#: Every process reads the table each second, so the statement is built once.
_EVERY: Final = select(cells).order_by(cells.c.network_id)


async def every(connection: AsyncConnection) -> tuple[NetworkCell, ...]:
    """All cells, in order of their networks."""
    found = await connection.execute(_EVERY)
    return tuple(_cell(row) for row in found)


async def of(connection: AsyncConnection, network_id: NetworkId) -> NetworkCell | None:
    """The cell of a network."""
    found = await connection.execute(select(cells).where(cells.c.network_id == network_id))
    row = found.one_or_none()
    return None if row is None else _cell(row)


async def refuse_another_cell(
    connection: AsyncConnection, current: NetworkId | None, network_id: NetworkId
) -> None:
    """Go on only if a drone may move its home from its current network to this network.

    Raises
    ------
    Conflict
        OTHER_CELL: another server serves this network, and has no record of the drone.
    """
    urls = {each.network_id: each.url for each in await every(connection)}
    if current is not None and urls.get(current) != urls.get(network_id):
        raise Conflict(
            "OTHER_CELL",
            f"the drone is at home in {current}, and another server serves {network_id}: remove "
            "the drone, and register it again",
        )


async def add(tx: Tx, network_id: NetworkId, *, url: str) -> None:
    """Add the cell of a network; RowRefused if the network already has a cell."""
    generation = await _next_generation(tx)
    row = {"network_id": network_id, "url": url, "state": "OPEN", "generation": generation}
    await tx.execute(cells.insert().values(row))


async def close(tx: Tx, cell: NetworkCell, *, wall_at: datetime) -> bool:
    """Close a cell; False if the cell has changed since it was read."""
    return await _change(tx, cell, state="CLOSED", closed_wall_ms=moment_to_ms(wall_at))


async def open_at(tx: Tx, seen: Collection[NetworkCell], *, url: str) -> bool:
    """Open these cells at a server; False if one of them has changed since it was read.

    After False the caller must leave the block without a commit.
    """
    in_order = sorted(seen, key=lambda each: each.network_id)
    done = [
        await _change(tx, cell, state="OPEN", url=url, closed_wall_ms=None) for cell in in_order
    ]
    return all(done)


async def _change(tx: Tx, cell: NetworkCell, **values: str | int | None) -> bool:
    row = {"generation": await _next_generation(tx), **values}
    as_seen = (cells.c.network_id == cell.network_id, cells.c.generation == cell.generation)
    return (await tx.execute(update(cells).where(*as_seen).values(row))).rowcount == 1


async def _next_generation(tx: Tx) -> int:
    newest = (await tx.execute(select(func.max(cells.c.generation)))).scalar_one_or_none()
    return int(newest or 0) + 1


def _cell(row: AnyRow) -> NetworkCell:
    closed_ms = row.closed_wall_ms
    return NetworkCell(
        network_id=row.network_id,
        url=row.url,
        state=row.state,
        generation=row.generation,
        closed_at=None if closed_ms is None else ms_to_moment(closed_ms),
    )
