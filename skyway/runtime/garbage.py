"""Garbage collection for processes that load much once and then answer for weeks.

Python looks through everything that lives, again and again; with the modules, models and planner
of a service that stops the event loop for 60 to 250 ms each time (measured: docs/load.md).
"""

import gc
from typing import Final

#: Python's own are (700, 10, 10): so often costs more than the little that is found.
_THRESHOLDS: Final = (20_000, 20, 20)


def keep_what_is_loaded() -> None:
    """Look no more at what is there now, and less often at what comes."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(*_THRESHOLDS)
