"""`skyway up` starts the small world only when an operator asks during this start."""

import asyncio
from pathlib import Path

from skyway.cli.data_folder import DataFolder
from skyway.cli.small_world.requested import until_requested


async def test_a_request_of_an_earlier_start_does_not_count(tmp_path: Path) -> None:
    folder = DataFolder(tmp_path)
    folder.small_world_request.touch()

    waiting = asyncio.create_task(until_requested(folder))
    await asyncio.sleep(0)
    assert not waiting.done()
    assert not folder.small_world_request.exists()
    folder.small_world_request.touch()

    async with asyncio.timeout(60):
        await waiting
