"""The lateness that nine of ten packages do not exceed, learned from packages that have come.

The method is split conformal prediction (Vovk, Gammerman and Shafer 2005). The score of a package
is its lateness as a share of its planned time. Sort n scores, and take
the score of rank ceil((n + 1) * level). At most a share of 1 - level of later packages has a larger
score, if these are like the n packages. The weather of a new day may differ from yesterday's. So
the level adapts: it rises with each package that comes after its P90, and falls with the others
(Gibbs and Candes 2021).

A provider with few packages borrows from the other providers of its network, with weights (Barber,
Candes, Ramdas and Tibshirani 2023). For a new provider all others together weigh as much as
`BORROWED` packages, and less the more packages of its own it has. Each of the other
providers weighs the same, so the largest provider counts no more than the others.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

#: The share of packages that should come by their P90.
COVERED: Final = 0.9
#: With fewer packages no P90 is known. Our own choice.
FEWEST: Final = 40
#: All other providers of the network together weigh as much as so many packages for a new provider,
#: which then has a P90. They weigh half as much when the provider has so many packages of its own.
#: Our own choice, as is the next number.
BORROWED: Final = FEWEST
#: The last packages of each other provider that count.
_OF_OTHERS: Final = 60
#: How far the level moves with one package, and its limits. Our own choice.
_STEP: Final = 0.02
_LEVELS: Final = (0.75, 0.97)
#: So that n + 1 times n / (n + 1) is n.
_ROUNDING: Final = 1e-9
#: Shorter planned times count as this, seconds: a minute must not become a large share.
_SHORTEST_S: Final = 300.0
#: The largest share of its planned time by which a package counts as late: a package that lay for
#: days says nothing about the others. Our own choice.
_LARGEST_SHARE: Final = 3.0


@dataclass(frozen=True, slots=True)
class PackageArrival:
    """A package that has come: its planned time from the drone's start, and its lateness, seconds.

    `was_covered` says whether it came by its P90; None if it had none.
    """

    planned_s: float
    late_s: float
    was_covered: bool | None


def late_share(
    own: Sequence[PackageArrival], others: Sequence[Sequence[PackageArrival]] = ()
) -> float | None:
    """The lateness that nine of ten packages do not exceed, as a share of the planned time.

    `own` are the packages of a provider, and `others` those of each other provider of its network,
    in the order in which they came. At least 0; None if all together weigh less than `FEWEST`.
    """
    groups = [each[-_OF_OTHERS:] for each in others if each]
    borrowed = min(BORROWED**2 / (BORROWED + len(own)), sum(map(len, groups)))
    weight = len(own) + borrowed
    if weight < FEWEST - _ROUNDING:
        return None
    level = len(own) * _level(own)
    level += borrowed * sum(map(_level, groups)) / max(1, len(groups))
    # Packages that weigh n support no higher level than n / (n + 1).
    needed = (weight + 1) * min(level / weight, weight / (weight + 1)) - _ROUNDING
    scores = [(_score(each), 1.0) for each in own]
    scores.extend(_shared_evenly(groups, weight=borrowed))
    return min(max(0.0, _weighted(scores, needed)), _LARGEST_SHARE)


def later_by_s(planned_s: float, share: float) -> float:
    """How much later a package with this planned time may come, seconds."""
    return share * max(planned_s, _SHORTEST_S)


def _score(arrival: PackageArrival) -> float:
    return arrival.late_s / max(arrival.planned_s, _SHORTEST_S)


def _shared_evenly(
    groups: Sequence[Sequence[PackageArrival]], *, weight: float
) -> Iterator[tuple[float, float]]:
    """The scores of the packages, each with its weight: each group weighs the same."""
    for group in groups:
        yield from ((_score(each), weight / len(groups) / len(group)) for each in group)


def _weighted(scores: Sequence[tuple[float, float]], needed: float) -> float:
    """The least score such that the scores up to it weigh as much as `needed`."""
    *smaller, (largest, _) = sorted(scores)
    for score, weight in smaller:
        needed -= weight
        if needed <= 0:
            return score
    return largest


def _level(arrivals: Sequence[PackageArrival]) -> float:
    level = COVERED
    for each in arrivals:
        if each.was_covered is not None:
            level += _STEP * (COVERED - each.was_covered)
            level = min(max(level, _LEVELS[0]), _LEVELS[1])
    return level
