"""Garbage collection for processes that load much at their start and then run for weeks.

Python scans all live objects again and again. With the modules, models and planner of a service
each scan stops the event loop for 60 to 250 ms (measured: docs/load.md).
"""

import gc
from typing import Final

#: Python's own are (700, 10, 10): such frequent scans cost more than the little garbage is worth.
_THRESHOLDS: Final = (5_000, 80, 20)


def load_without_collecting() -> None:
    """Scan nothing until `keep_what_is_loaded`: modules stay, and scans are a sixth of loading."""
    gc.disable()


def keep_what_is_loaded() -> None:
    """Never scan the present objects again, and scan later objects less often."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(*_THRESHOLDS)
    gc.enable()
