"""Which candidates are composed at all: those that could still win, or change who wins."""

from collections.abc import Sequence
from dataclasses import dataclass

from skyway.contracts.candidate import Candidate
from skyway.delivery.offer import BestValues, OfferValues
from skyway.delivery.request import Weights
from skyway_composition.planning.least import Least

#: Values that differ by this share or less differ by rounding only.
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class Twins:
    """Candidates with the same plan: same model, place, charge and home; and their bounds."""

    candidates: tuple[Candidate, ...]
    least: tuple[OfferValues, ...]


def twins_among(candidates: Sequence[Candidate], least: Least) -> list[Twins]:
    """The candidates in groups that are composed once."""
    groups: dict[object, list[Candidate]] = {}
    for each in candidates:
        plan_of = (each.model, each.station_id, each.soc, each.home_station_id)
        groups.setdefault(plan_of, []).append(each)
    return [Twins(tuple(group), least.values(group)) for group in groups.values()]


def next_to_compose(
    waiting: Sequence[Twins], found: Sequence[OfferValues], weights: Weights
) -> Twins | None:
    """The twins to compose next; None when the best of the offers found is certain to win.

    Scores are relative to the best values, so whoever could improve one of those that count is
    composed first, even where it cannot win itself. Then the best values are final, and nobody is
    composed whose bounds score no better than the best offer does.
    """
    if not waiting:
        return None
    if not found:
        return _most_promising(waiting, weights)
    best = BestValues.of(found)
    improving = [
        twins for twins in waiting if any(_improves(each, best, weights) for each in twins.least)
    ]
    if improving:
        return _most_promising(improving, weights)
    leading = min(best.rank(each, weights) for each in found)
    return next(
        (
            twins
            for twins in waiting
            if any(best.rank(each, weights) < leading for each in twins.least)
        ),
        None,
    )


def _improves(least: OfferValues, best: BestValues, weights: Weights) -> bool:
    less = 1 - _ROUNDING
    return (
        (weights.time > 0 and least.time_s < best.time_s * less)
        or (weights.price > 0 and least.price < best.price * less)
        or (weights.energy > 0 and least.energy_j < best.energy_j * less)
    )


def _most_promising(waiting: Sequence[Twins], weights: Weights) -> Twins:
    best = BestValues.of(each for twins in waiting for each in twins.least)
    return min(waiting, key=lambda twins: min(best.rank(each, weights) for each in twins.least))
