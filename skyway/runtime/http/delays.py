"""Delays for callers: answers without a budget come later, and wrong keys make an address wait.

All is counted in the memory of one process.
"""

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass
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


#: Wrong keys that cause no wait: a person mistypes, or a program has an old key.
_FREE: Final = 10

#: The first wait and the longest, seconds of wall time; each wrong key doubles the wait.
_FIRST_S: Final = 0.5
_LONGEST_S: Final = 60.0

#: After so many seconds without a wrong key its earlier ones are forgotten.
_FORGOTTEN_S: Final = 600.0

#: The most addresses that are remembered, about 200 bytes each.
_MOST_REMEMBERED: Final = 20_000


@dataclass(frozen=True, slots=True)
class _Guesses:
    number: int
    last_at: float
    until: float


class WrongKeys:
    """How long each address waits before another key of it is looked up.

    When the memory is full, the address that was silent for longest is forgotten.

    Parameters
    ----------
    now
        Seconds of a clock that never goes back.
    """

    def __init__(
        self, *, most: int = _MOST_REMEMBERED, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._most = most
        self._now = now
        #: The address that showed a wrong key last is last.
        self._guesses: dict[str, _Guesses] = {}

    def note(self, address: str) -> None:
        """Count a wrong key that was looked up."""
        now, before = self._now(), self._guesses.pop(address, None)
        is_known = before is not None and now - before.last_at < _FORGOTTEN_S
        number = before.number + 1 if before is not None and is_known else 1
        # Bounded before the power is taken: a float does not hold two to any power.
        doublings = min(number - _FREE, 10)
        wait_s = 0.0 if doublings < 0 else min(_FIRST_S * 2.0**doublings, _LONGEST_S)
        self._guesses[address] = _Guesses(number, now, now + wait_s)
        if len(self._guesses) > self._most:
            del self._guesses[next(iter(self._guesses))]

    def wait_s(self, address: str) -> float:
        """Seconds of wall time for which the address must wait; 0 if it need not."""
        guesses = self._guesses.get(address)
        return 0.0 if guesses is None else max(guesses.until - self._now(), 0.0)

    @property
    def remembered(self) -> int:
        """How many addresses are in memory."""
        return len(self._guesses)
