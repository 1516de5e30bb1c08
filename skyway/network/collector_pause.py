"""Big documents without the garbage collector, which would look through them again and again."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def collector_paused() -> Iterator[None]:
    """Collect no cycles meanwhile.

    A JSON document has none, and looking for them takes as long as making it. What counts
    references goes on. When two threads pause at once, the first to end ends it for both.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
