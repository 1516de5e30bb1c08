"""The lateness that nine of ten packages do not exceed, from packages that have come.

The method is split conformal prediction (Vovk, Gammerman and Shafer 2005). The score of a package
is its lateness as a share of its planned time. Of n scores, the one of rank ceil((n + 1) * level)
is exceeded by at most a share of 1 - level of later packages, if these are like the n packages. The
weather of a new day is not like yesterday's. So the level adapts: it rises with each package that
comes later than was forecast, and falls with the others (Gibbs and Candes 2021).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

#: The share of packages that should come by their P90.
COVERED: Final = 0.9
#: With fewer packages nothing is forecast. Our own choice.
FEWEST: Final = 40
#: How far the level moves with one package, and its limits. Our own choice.
_STEP: Final = 0.02
_LEVELS: Final = (0.75, 0.97)
#: So that n + 1 times n / (n + 1) is n.
_ROUNDING: Final = 1e-9
#: Shorter planned times count as this, seconds: a minute must not become a large share.
_SHORTEST_S: Final = 300.0
#: A package that is later by more than this share of its planned time counts as so late: one that
#: lay for days says nothing about the others. Our own choice.
_LARGEST_SHARE: Final = 3.0


@dataclass(frozen=True, slots=True)
class Arrival:
    """A package that has come: its planned time from the drone's start, and its lateness, seconds.

    `was_covered` says whether it came by its P90; None if it had none.
    """

    planned_s: float
    late_s: float
    was_covered: bool | None


def late_share(arrivals: Sequence[Arrival]) -> float | None:
    """The lateness that nine of ten packages do not exceed, as a share of the planned time.

    `arrivals` are in the order in which they came. At least 0; None for fewer than `FEWEST`.
    """
    if len(arrivals) < FEWEST:
        return None
    scores = sorted(each.late_s / max(each.planned_s, _SHORTEST_S) for each in arrivals)
    count = len(scores)
    # From n packages no higher level can be forecast than n / (n + 1).
    level = min(_level(arrivals), count / (count + 1))
    rank = math.ceil((count + 1) * level - _ROUNDING)
    return min(max(0.0, scores[rank - 1]), _LARGEST_SHARE)


def later_by_s(planned_s: float, share: float) -> float:
    """How much later a package with this planned time may come, seconds."""
    return share * max(planned_s, _SHORTEST_S)


def _level(arrivals: Sequence[Arrival]) -> float:
    level = COVERED
    for each in arrivals:
        if each.was_covered is not None:
            level += _STEP * (COVERED - each.was_covered)
            level = min(max(level, _LEVELS[0]), _LEVELS[1])
    return level
