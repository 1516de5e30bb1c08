"""How much a process gives way to others where all want the processor (nice(1))."""

import os
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

#: How much nicer simulated drones are than the system, in steps of nice(1): where all want the
#: processor they get a third of the time.
SIMULATES: Final = 5

_NICEST: Final = 19
#: Linux changes the niceness of a group at most once in this many seconds, except for root.
_BETWEEN_GROUPS_S: Final = 0.1
_TRIES: Final = 20


def give_way(pid: int, *, by: int) -> None:
    """Make a new process nicer than this one; do nothing where the system has no niceness.

    This needs no privileges, and children of the process inherit it.
    """
    if not hasattr(os, "setpriority"):
        return
    niceness = min(os.getpriority(os.PRIO_PROCESS, 0) + by, _NICEST)
    with suppress(OSError):  # it may have ended, or it may be nicer already
        os.setpriority(os.PRIO_PROCESS, pid, niceness)
        if os.getsid(pid) == pid:
            _give_way_as_group(pid, niceness)


def _give_way_as_group(pid: int, niceness: int) -> None:
    """Make the process's session nicer too.

    With autogroup on, as on most desktops, Linux first shares a processor among sessions. The
    niceness of processes counts only within a session (sched(7)).
    """
    group = Path(f"/proc/{pid}/autogroup")
    for _ in range(_TRIES if group.exists() else 0):
        try:
            group.write_text(str(niceness))
        except BlockingIOError:
            time.sleep(_BETWEEN_GROUPS_S)
        else:
            return
