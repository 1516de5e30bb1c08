"""How much memory a call needs at its peak, beyond what the process held before."""

import ctypes
import gc
from collections.abc import Callable
from pathlib import Path

_STATUS = Path("/proc/self/status")
_CLEAR_REFS = Path("/proc/self/clear_refs")
#: Resets the peak of the resident memory (proc(5)).
_RESET_PEAK = "5"


def peak_growth_mib(call: Callable[[], object]) -> float | None:
    """Growth of the resident memory's peak while this runs; None where Linux does not report it."""
    gc.collect()
    try:
        # Memory freed before must go back to the system, or the call would reuse it without growth.
        ctypes.CDLL(None).malloc_trim(0)
        _CLEAR_REFS.write_text(_RESET_PEAK)
        before_mib = _field_mib("VmRSS")
    except (OSError, AttributeError):
        return None
    call()
    return max(0.0, _field_mib("VmHWM") - before_mib)


def _field_mib(name: str) -> float:
    lines = _STATUS.read_text().splitlines()
    return int(next(line for line in lines if line.startswith(f"{name}:")).split()[1]) / 1024
