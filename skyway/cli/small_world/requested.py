"""Operators ask for the small world in the console: the gateway makes a file, we wait for it."""

import asyncio
from typing import Final

from skyway.cli.data_folder import DataFolder

_LOOK_EVERY_S: Final = 0.5


async def until_requested(folder: DataFolder) -> None:
    """Wait until an operator asks for the small world; requests of earlier starts do not count."""
    folder.small_world_request.unlink(missing_ok=True)
    # Another process makes the file, so no event of this one can be awaited.
    while not folder.small_world_request.exists():  # noqa: ASYNC110
        await asyncio.sleep(_LOOK_EVERY_S)
