"""Waiting for whichever comes first."""

import asyncio
from collections.abc import Coroutine
from typing import Any


async def first_of(*runners: Coroutine[Any, Any, object]) -> None:
    """Run all until the first ends, cancel the others, and raise what the first raised."""
    tasks = {asyncio.ensure_future(runner) for runner in runners}
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for task in done:
        task.result()
