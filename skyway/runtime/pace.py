"""How often something is done that many ask for at once."""

import asyncio
import math


class Pace:
    """Lets a turn begin at most every `every_s` of wall time; the first after a rest at once.

    With `burst`, so many turns that were not taken may be taken later, `least_s` apart.
    """

    def __init__(self, every_s: float = 0.0, *, burst: int = 0, least_s: float = 0.0) -> None:
        self._every_s = every_s
        self._ahead_s = burst * every_s
        self._least_s = least_s
        self._began_s = -math.inf
        self._due_s = -math.inf  # when the next turn would begin, had none come early

    async def turn(self) -> None:
        """Wait until the next turn may begin; one at a time waits."""
        loop = asyncio.get_running_loop()
        earliest_s = max(self._due_s - self._ahead_s, self._began_s + self._least_s)
        await asyncio.sleep(max(0.0, earliest_s - loop.time()))
        self._began_s = loop.time()
        self._due_s = max(self._due_s, self._began_s) + self._every_s
