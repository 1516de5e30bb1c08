"""Which block makes which kind of fault."""

from collections.abc import Mapping
from contextlib import AbstractAsyncContextManager
from typing import Final

from skyway_lab.benchmarks.chaos.faults.databases import full, immutable, locked, read_only
from skyway_lab.benchmarks.chaos.faults.limits import no_descriptors, no_memory, unwritable_journals
from skyway_lab.benchmarks.chaos.faults.poison import poisoned
from skyway_lab.benchmarks.chaos.faults.processes import away, frozen, journals_lost, killed
from skyway_lab.benchmarks.chaos.faults.stage import Fault, Stage
from skyway_lab.benchmarks.chaos.faults.wires import cut, silenced, slowed
from skyway_lab.benchmarks.chaos.schedule import PlannedFault

FAULTS: Final[Mapping[str, Fault]] = {
    "kill": killed,
    "freeze": frozen,
    "away": away,
    "long away": away,
    "cut": cut,
    "silence": silenced,
    "slow": slowed,
    "read-only": read_only,
    "locked": locked,
    "immutable": immutable,
    "full disk": full,
    "unwritable journal": unwritable_journals,
    "lost journal": journals_lost,
    "no descriptors": no_descriptors,
    "no memory": no_memory,
    "poison": poisoned,
}


def acting(stage: Stage, fault: PlannedFault) -> AbstractAsyncContextManager[None]:
    """The block of this fault."""
    return FAULTS[fault.kind.name](stage, fault)
