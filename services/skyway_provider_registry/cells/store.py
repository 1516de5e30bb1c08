"""All SQL of the table of cells."""

from collections.abc import Collection

from sqlalchemy import func, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.cells import CellState, NetworkCell
from skyway.ids import NetworkId
from skyway.runtime.errors import Conflict
from skyway.runtime.sql.database import Tx
from skyway_provider_registry.tables import cells


async def every(connection: AsyncConnection) -> tuple[NetworkCell, ...]:
    """All cells, in order of their networks."""
    found = await connection.execute(select(cells).order_by(cells.c.network_id))
    return tuple(NetworkCell.model_validate(row._asdict()) for row in found)


async def of(connection: AsyncConnection, network_id: NetworkId) -> NetworkCell | None:
    """The cell of a network."""
    found = await connection.execute(select(cells).where(cells.c.network_id == network_id))
    row = found.one_or_none()
    return None if row is None else NetworkCell.model_validate(row._asdict())


async def refuse_another_cell(
    connection: AsyncConnection, current: NetworkId | None, network_id: NetworkId
) -> None:
    """Go on only if a drone that is at home in one network may have its home in another.

    Raises
    ------
    Conflict
        OTHER_CELL: another server serves that network. It has no record of the drone.
    """
    urls = {each.network_id: each.url for each in await every(connection)}
    if current is not None and urls.get(current) != urls.get(network_id):
        raise Conflict(
            "OTHER_CELL",
            f"the drone is at home in {current}, and another server serves {network_id}: remove "
            "the drone, and register it again",
        )


async def add(tx: Tx, network_id: NetworkId, *, url: str) -> None:
    """Add the cell of a network; RowRefused if the network has one."""
    generation = await _next_generation(tx)
    row = {"network_id": network_id, "url": url, "state": "OPEN", "generation": generation}
    await tx.execute(cells.insert().values(row))


async def change(
    tx: Tx, seen: Collection[NetworkCell], *, state: CellState, url: str | None = None
) -> bool:
    """Change these cells, unless one of them has changed since it was seen: then False.

    The caller leaves the block without a commit after False.
    """
    for cell in sorted(seen, key=lambda each: each.network_id):
        values = {"state": state, "generation": await _next_generation(tx), "url": url or cell.url}
        as_seen = (cells.c.network_id == cell.network_id, cells.c.generation == cell.generation)
        changed = await tx.execute(update(cells).where(*as_seen).values(values))
        if changed.rowcount != 1:
            return False
    return True


async def _next_generation(tx: Tx) -> int:
    newest = (await tx.execute(select(func.max(cells.c.generation)))).scalar_one_or_none()
    return int(newest or 0) + 1
