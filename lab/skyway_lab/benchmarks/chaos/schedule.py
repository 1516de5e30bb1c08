"""Which fault comes when: a shuffled deck of all faults, the same for the same seed."""

import random
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from skyway_lab.benchmarks.chaos.fault_kinds import KINDS, FaultKind
from skyway_lab.benchmarks.load.burst import Storage

from skyway.errors import SkywayError

#: Wall seconds of calm before a fault, least and most.
LEAST_CALM_S: Final = 3.0
_MOST_CALM_S: Final = 8.0
#: The share of faults that come before the system has recovered from the one before.
_EARLY: Final = 0.3


@dataclass(frozen=True, slots=True)
class PlannedFault:
    """A fault of the schedule; seconds are of wall time.

    It comes `calm_s` after the fault before it has healed, or after the system has recovered from
    that if it `waits_for_recovery`.
    """

    kind: FaultKind
    target: str
    calm_s: float
    waits_for_recovery: bool
    lasts_s: float
    #: The chance that the fault has of its own.
    seed: int

    @property
    def name(self) -> str:
        """The name under which its figures are collected."""
        return f"{self.kind.name}: {self.target}"


def faults_for(
    storage: Storage, *, only: Collection[str] = (), without: Collection[str] = (), is_root: bool
) -> list[tuple[FaultKind, str]]:
    """All kinds of faults with their targets; `only` and `without` name kinds or faults.

    Raises
    ------
    SkywayError
        A name is of no fault of this pair; the message lists all faults.
    """
    every = [(kind, target) for kind in KINDS for target in kind.targets(storage)]
    names = {name for each in every for name in _names(*each)}
    if unknown := {*only, *without} - names:
        raise SkywayError(
            f"no fault of the {storage} pair is called {', '.join(sorted(unknown))}; "
            f"there are {', '.join(sorted(names))}"
        )
    return [
        (kind, target)
        for kind, target in every
        if (is_root or not kind.needs_root)
        and (not only or _names(kind, target) & set(only))
        and not _names(kind, target) & set(without)
    ]


def _names(kind: FaultKind, target: str) -> set[str]:
    return {kind.name, f"{kind.name}: {target}"}


def schedule(faults: Sequence[tuple[FaultKind, str]], *, seed: int) -> Iterator[PlannedFault]:
    """Faults without end; each comes once before one comes twice."""
    chance = random.Random(seed)
    while True:
        for kind, target in chance.sample(faults, len(faults)):
            yield PlannedFault(
                kind,
                target,
                calm_s=chance.uniform(LEAST_CALM_S, _MOST_CALM_S),
                waits_for_recovery=chance.random() >= _EARLY,
                lasts_s=chance.uniform(*kind.lasts_s),
                seed=chance.getrandbits(32),
            )
