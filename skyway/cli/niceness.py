"""Who gives way to whom while processes share one machine.

What answers people must not wait behind what computes or simulates: a processor that is short goes
to the gateway, the registry and the broker first, then to composition, whose answers are waited for
by other processes, and to simulated drones last. In production each has processors of its own, or
shares of them that its platform sets.
"""

import os
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

#: How much nicer than what answers people, in steps of nice(1): where all want the processor, a
#: process gets half of its time at 3, a third at 5. At 10 it would be a tenth, and drones lost
#: their connections whenever anything else kept the machine busy.
COMPUTES: Final = 3
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
