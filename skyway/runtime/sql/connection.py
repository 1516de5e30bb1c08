"""The connection of a read or write block, and the types of rows and parameters."""

from collections.abc import AsyncIterator, Mapping, Sequence
from typing import Any, Final

from sqlalchemy import Executable, Row
from sqlalchemy.engine import CursorResult
from sqlalchemy.ext.asyncio import AsyncConnection

#: A row of any query. Any: its columns have every type.
AnyRow = Row[*tuple[Any, ...]]

#: Values by the name of a parameter or a column. Any: a column takes values of every type.
Values = Mapping[str, Any]

#: Rows in memory at a time, of queries with many rows.
_ROWS_AT_A_TIME: Final = 500


async def each_row(connection: AsyncConnection, query: Executable) -> AsyncIterator[AnyRow]:
    """The rows of a query one by one, for queries with more rows than fit into memory."""
    async with connection.stream(query) as found:
        # Row by row, the hop from the event loop to the driver takes longer than the row.
        async for rows in found.partitions(_ROWS_AT_A_TIME):
            for row in rows:
                yield row


class BlockConnection(AsyncConnection):
    """The connection of a write block. The block cannot end its transaction."""

    async def commit(self) -> None:
        """Refuse: one half of a block must never be stored without the other."""
        raise RuntimeError("only leaving a write block commits")

    async def rollback(self) -> None:
        """Refuse: on SQLite this would undo the other blocks of the same COMMIT."""
        raise RuntimeError("only an error rolls a write block back")

    async def execute_last(
        self, statement: Executable, parameters: Values | Sequence[Values]
    ) -> CursorResult[*tuple[Any, ...]]:
        """Run the last statement of a write block. Any: columns have every type."""
        return await self.execute(statement, parameters)
