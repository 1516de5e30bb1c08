"""Slows callers that go on after their budget is spent: their answers are delayed."""

import asyncio
from typing import Final

#: Delay of such an answer, wall seconds. A caller that waits for its answers on a few connections
#: then calls less often.
_HELD_S: Final = 0.5

#: The most answers that are delayed at the same time; further answers are not delayed. The number
#: is below the connections of one address, so that other callers of the address are not shut out.
_MOST_HELD: Final = 200


class Brake:
    """Holds back the answers to calls without a budget."""

    def __init__(self, *, held_s: float = _HELD_S, most_held: int = _MOST_HELD) -> None:
        self._held_s = held_s
        self._most_held = most_held
        self._held = 0

    async def hold(self) -> None:
        """Wait, unless too many wait already."""
        if self._held >= self._most_held:
            return
        self._held += 1
        try:
            await asyncio.sleep(self._held_s)
        finally:
            self._held -= 1
