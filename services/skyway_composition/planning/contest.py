"""Which candidates are composed at all: those that could still win, or change who wins."""

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import BestValues, OfferValues
from skyway.delivery.request import Weights
from skyway.network.columns import Floats
from skyway_composition.planning.lower_bounds import Least

#: Values that differ by this share or less differ by rounding only.
_ROUNDING: Final = 1e-9

#: Scores are told apart in fewer digits: whoever is farther away is not looked at more closely.
_SAME_SCORE: Final = 1e-8


class Contest:
    """The candidates of a shortlist that wait to be composed, by their rows and their bounds.

    Scores are relative to the best values, so whoever could improve one of those that count is
    composed first, even where it cannot win itself. Then the best values are final, and nobody is
    composed whose bounds score no better than the best offer does.
    """

    def __init__(self, shortlist: Shortlist, least: Least, weights: Weights) -> None:
        self._shortlist = shortlist
        self._least = least
        self._weights = weights
        self._twins = _twins_among(shortlist)
        self._is_waiting = np.ones(len(shortlist.drone_ids), np.bool_)

    def leave_out(self, rows: Sequence[int]) -> None:
        """Do not compose for these."""
        self._is_waiting[rows] = False

    def next_to_compose(self, found: Sequence[OfferValues]) -> list[int]:
        """The rows to compose next, which have one plan; none when the best found wins for sure."""
        first = self._next(found)
        if first is None:
            return []
        alike = self._is_waiting & (self._twins == self._twins[first])
        rows: list[int] = np.flatnonzero(alike).tolist()
        self.leave_out(rows)
        return rows

    def _next(self, found: Sequence[OfferValues]) -> int | None:
        waiting = np.flatnonzero(self._is_waiting)
        if not waiting.size:
            return None
        if not found:
            return self._most_promising(waiting)
        best = BestValues.of(found)
        improving = waiting[self._improves(best)[waiting]]
        if improving.size:
            return self._most_promising(improving)
        leading = min(best.rank(each, self._weights) for each in found)
        close = waiting[self._scores(best)[waiting] < leading[0] + _SAME_SCORE]
        return next(
            (
                row
                for row in close.tolist()
                if best.rank(self._values(row), self._weights) < leading
            ),
            None,
        )

    def _most_promising(self, rows: npt.NDArray[np.intp]) -> int:
        least = self._least
        best = BestValues(
            float(least.time_s[rows].min()),
            int(least.price[rows].min()),
            float(least.energy_j[rows].min()),
        )
        scores = self._scores(best)[rows]
        close: list[int] = rows[scores <= scores.min() + _SAME_SCORE].tolist()
        return min(close, key=lambda row: best.rank(self._values(row), self._weights))

    def _improves(self, best: BestValues) -> npt.NDArray[np.bool_]:
        """Who may be better than this in one of the values that count."""
        improves = np.zeros(len(self._is_waiting), np.bool_)
        for _, values, best_value in self._counting(best):
            improves |= values < best_value * (1 - _ROUNDING)
        return improves

    def _scores(self, best: BestValues) -> Floats:
        """What `BestValues.score` says of each row's bounds."""
        scores = np.zeros(len(self._is_waiting))
        for weight, values, best_value in self._counting(best):
            scores += weight * (values / best_value if best_value > 0 else 1.0 + values)
        return scores

    def _counting(self, best: BestValues) -> Iterator[tuple[float, Floats, float]]:
        """Weight, bounds and best value of time, price and energy, of those that tell apart.

        What weighs nothing does not, nor what is infinite for everybody.
        """
        weights, least = self._weights, self._least
        for weight, values, best_value in (
            (weights.time, least.time_s, best.time_s),
            (weights.price, least.price, best.price),
            (weights.energy, least.energy_j, best.energy_j),
        ):
            if weight > 0 and best_value < math.inf:
                yield weight, values, best_value

    def _values(self, row: int) -> OfferValues:
        least, shortlist = self._least, self._shortlist
        return OfferValues(
            float(least.time_s[row]),
            int(least.price[row]),
            float(least.energy_j[row]),
            shortlist.provider_ids[row],
            shortlist.drone_ids[row],
        )


def _twins_among(shortlist: Shortlist) -> npt.NDArray[np.intp]:
    """A number for each row, the same for those with one plan: same model, place, charge, home."""
    numbers: dict[object, int] = {}
    plans = zip(
        shortlist.model_ids,
        shortlist.station_ids,
        shortlist.socs,
        shortlist.home_station_ids,
        strict=True,
    )
    return np.array([numbers.setdefault(plan, len(numbers)) for plan in plans])
