"""What a process does while it loads its modules, if it then runs for weeks.

Python's garbage collection scans all live objects again and again. With the modules, models and
planner of a service each scan stops the event loop for 60 to 250 ms (measured: docs/load.md).
"""

import gc
import sys
from typing import Final

#: Python's own are (700, 10, 10): such frequent scans cost more than the little garbage is worth.
_THRESHOLDS: Final = (5_000, 80, 20)


def begin_loading() -> None:
    """Load faster and smaller.

    Nothing is scanned until `keep_what_is_loaded`: modules stay, and scans are a sixth of loading.
    httpx does not load its own command line, which would take 5 MiB for rich and pygments.
    """
    gc.disable()
    sys.modules["httpx._main"] = None  # type: ignore[assignment]  # so its import fails, as planned


def keep_what_is_loaded() -> None:
    """Never scan the present objects again, and scan later objects less often."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(*_THRESHOLDS)
    gc.enable()
