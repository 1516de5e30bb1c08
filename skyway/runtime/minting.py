"""How a process makes new identifiers: unique everywhere, sorted by their time."""

import secrets
import time
from collections import Counter
from collections.abc import Callable

from skyway.ids import sortable_id

#: Makes a new identifier with this prefix: ``mint("dlv")``.
Mint = Callable[[str], str]


def mint(prefix: str) -> str:
    """A new identifier of wall time and chance."""
    return sortable_id(prefix, unix_ms=time.time_ns() // 1_000_000, entropy=secrets.randbits(80))


class CountingMint:
    """The same identifiers in every run: the prefix, and a count of its own."""

    def __init__(self) -> None:
        self._minted: Counter[str] = Counter()

    def __call__(self, prefix: str) -> str:
        """The next identifier with this prefix."""
        self._minted[prefix] += 1
        return f"{prefix}_{self._minted[prefix]:06d}"
