"""Limits what a caller may have open at the same time, counted in the memory of one process."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from skyway.runtime.errors import BudgetSpent

#: Seconds until another try; when a slot becomes free is unknown.
_RETRY_AFTER_S: Final = 1.0


class Slots:
    """The same number of slots for each caller; `code` names them in problem documents."""

    def __init__(self, code: str, most: int) -> None:
        self.code = code
        self.most = most
        self._used: dict[str, int] = {}

    @contextmanager
    def held(self, who: str) -> Iterator[None]:
        """One slot of the caller, while the block runs.

        Raises
        ------
        BudgetSpent
            All slots of the caller are in use.
        """
        used = self.used(who)
        if used >= self.most:
            raise BudgetSpent(self.code, _RETRY_AFTER_S)
        self._used[who] = used + 1
        try:
            yield
        finally:
            self._used[who] -= 1
            if self._used[who] == 0:
                del self._used[who]

    def used(self, who: str) -> int:
        """How many slots the caller has in use."""
        return self._used.get(who, 0)
