"""How often something is done that many ask for at once."""

import asyncio
import math


class Pace:
    """Lets a turn begin at most every `every_s` of wall time; the first after a rest at once."""

    def __init__(self, every_s: float = 0.0) -> None:
        self._every_s = every_s
        self._began_s = -math.inf

    async def turn(self) -> None:
        """Wait until the next turn may begin; one at a time waits."""
        loop = asyncio.get_running_loop()
        await asyncio.sleep(max(0.0, self._began_s + self._every_s - loop.time()))
        self._began_s = loop.time()
