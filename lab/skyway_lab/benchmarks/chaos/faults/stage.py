"""What faults act on."""

from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass

from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone
from skyway_lab.benchmarks.chaos.journals import Journals
from skyway_lab.benchmarks.chaos.schedule import PlannedFault
from skyway_lab.benchmarks.chaos.small_disk import SmallDisk
from skyway_lab.benchmarks.chaos.system import ChaosSystem


@dataclass(frozen=True, slots=True)
class Stage:
    """The running system, and who may publish false messages in it."""

    running: ChaosSystem
    #: Drones that fly; messages in their names take their place at the broker for a moment.
    drones: tuple[EnrolledDrone, ...]
    #: A drone that no agent serves and that no provider offers.
    rogue: EnrolledDrone
    #: What drones fly, so that others can make false claims about it.
    journals: Journals
    #: The disk of the SQLite databases, where it could be made.
    disk: SmallDisk | None


#: A block that begins with the fault and ends with its healing.
Fault = Callable[[Stage, PlannedFault], AbstractAsyncContextManager[None]]
