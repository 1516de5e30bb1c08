"""The connection of a block, which cannot end the block's transaction."""

from sqlalchemy.ext.asyncio import AsyncConnection


class BlockConnection(AsyncConnection):
    """A connection to read from and, in a write block, to read what the block has written."""

    async def commit(self) -> None:
        """Refuse: half of a block must never be kept."""
        raise RuntimeError("only leaving a write block commits")

    async def rollback(self) -> None:
        """Refuse: on SQLite that would undo the other blocks of the same COMMIT."""
        raise RuntimeError("only an error rolls a write block back")
