"""Who gives way to whom while processes share one machine.

What simulates much in a short test of load must not take the processor from what is measured:
real drones bring their own. Whatever has to keep the pace of a fast fleet clock gives way to
nobody: on a busy machine a demo's drones then answered after two seconds, when loading had been
given up.
"""

import os
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

#: How much nicer simulated drones are than the system, in steps of nice(1): where all want the
#: processor they get a third of the time.
SIMULATES: Final = 5

_NICEST: Final = 19
#: Linux changes one group in so many seconds, unless root asks.
_BETWEEN_GROUPS_S: Final = 0.1
_TRIES: Final = 20


def give_way(pid: int, *, by: int) -> None:
    """Make a process that has just begun nicer than this one; where that is unknown, do nothing.

    Being nicer needs no rights, and what the process starts later is as nice.
    """
    if not hasattr(os, "setpriority"):
        return
    niceness = min(os.getpriority(os.PRIO_PROCESS, 0) + by, _NICEST)
    with suppress(OSError):  # it may have ended, or be nicer already
        os.setpriority(os.PRIO_PROCESS, pid, niceness)
        if os.getsid(pid) == pid:
            _give_way_as_group(pid, niceness)


def _give_way_as_group(pid: int, niceness: int) -> None:
    """The same for the process's session.

    With autogroup on, as on most desktops, Linux shares a processor among sessions first, and looks
    at the niceness of processes only within one (sched(7)).
    """
    group = Path(f"/proc/{pid}/autogroup")
    for _ in range(_TRIES if group.exists() else 0):
        try:
            group.write_text(str(niceness))
        except BlockingIOError:
            time.sleep(_BETWEEN_GROUPS_S)
        else:
            return
