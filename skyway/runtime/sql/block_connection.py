"""The connection of a block, which cannot end the block's transaction."""

from collections.abc import Mapping
from typing import Any

from sqlalchemy import Executable
from sqlalchemy.engine import CursorResult
from sqlalchemy.ext.asyncio import AsyncConnection


class BlockConnection(AsyncConnection):
    """A connection to read from and, in a write block, to read what the block has written."""

    async def commit(self) -> None:
        """Refuse: half of a block must never be kept."""
        raise RuntimeError("only leaving a write block commits")

    async def rollback(self) -> None:
        """Refuse: on SQLite that would undo the other blocks of the same COMMIT."""
        raise RuntimeError("only an error rolls a write block back")

    async def execute_last(
        self, statement: Executable, parameters: Mapping[str, Any]
    ) -> CursorResult[*tuple[Any, ...]]:
        """Run the last statement of a write block. Any: what columns take."""
        return await self.execute(statement, parameters)
