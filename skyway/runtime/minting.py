"""How a process makes new identifiers: unique everywhere, sorted by their time."""

import secrets
import time
from collections.abc import Callable

from skyway.ids import sortable_id

#: Makes a new identifier with this prefix: ``mint("dlv")``.
Mint = Callable[[str], str]


def mint(prefix: str) -> str:
    """A new identifier of wall time and chance."""
    return sortable_id(prefix, unix_ms=time.time_ns() // 1_000_000, entropy=secrets.randbits(80))
