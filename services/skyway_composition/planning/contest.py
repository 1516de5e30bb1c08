"""Decides which candidates to compose: those that could win, or change which one wins."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import BestValues, OfferValues, no_show_factor
from skyway.delivery.qos import Weights
from skyway.ids import DroneId
from skyway.network.columns import Floats
from skyway_composition.planning.availability import Opening
from skyway_composition.planning.lower_bounds import LowerBounds

#: Values whose relative difference is at most this differ by rounding only.
_ROUNDING: Final = 1e-9

#: Scores that differ by less are compared exactly; a larger difference decides without that.
_SAME_SCORE: Final = 1e-8


class Contest:
    """The candidates of a shortlist that wait to be composed, by their rows and lower bounds.

    Scores are relative to the best values. So a candidate that could improve a best value is
    composed first, even if it cannot win. After that the best values are final, and a candidate
    is composed only if its lower bounds score better than the best offer.
    """

    def __init__(
        self,
        shortlist: Shortlist,
        least: LowerBounds,
        weights: Weights,
        *,
        openings: Mapping[DroneId, Opening],
    ) -> None:
        self._shortlist = shortlist
        self._least = least
        self._weights = weights
        self._twins = _twins_among(shortlist, openings)
        self._factors: Floats = np.array(
            [no_show_factor(shortlist.terms_of[each].no_shows) for each in shortlist.provider_ids]
        )
        self._is_waiting = np.ones(len(shortlist.drone_ids), np.bool_)

    def leave_out(self, rows: Sequence[int]) -> None:
        """Never compose for these candidates."""
        self._is_waiting[rows] = False

    def next_to_compose(self, found: Sequence[OfferValues]) -> list[int]:
        """The rows to compose next, which share one plan; empty when the best offer must win."""
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
        """The candidates that may be better than `best` in a value with weight."""
        improves = np.zeros(len(self._is_waiting), np.bool_)
        for _, values, best_value in self._counting(best):
            improves |= values < best_value * (1 - _ROUNDING)
        return improves

    def _scores(self, best: BestValues) -> Floats:
        """The score of each row's lower bounds, as `BestValues.score` computes it."""
        scores = np.zeros(len(self._is_waiting))
        for weight, values, best_value in self._counting(best):
            scores += weight * (values / best_value if best_value > 0 else 1.0 + values)
        scores *= self._factors
        return scores

    def _counting(self, best: BestValues) -> Iterator[tuple[float, Floats, float]]:
        """Weight, lower bounds and best value of time, price and energy, where they matter.

        Left out: values without weight, and values that are infinite for all candidates.
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
            shortlist.terms_of[shortlist.provider_ids[row]].no_shows,
        )


def _twins_among(shortlist: Shortlist, openings: Mapping[DroneId, Opening]) -> npt.NDArray[np.intp]:
    """A number for each row; rows with equal kind, place, charge, home and standby share one.

    Where NEXT_PICKUP leads depends on the requests of the provider, so there drones of different
    providers share no number.
    A drone that has other missions shares its number with no other drone, because the pads of
    those missions are free for this drone only.
    """
    numbers: dict[object, int] = {}
    plans = zip(
        shortlist.kinds,
        shortlist.station_ids,
        shortlist.socs,
        shortlist.home_station_ids,
        shortlist.standbys,
        (
            provider_id if standby == "NEXT_PICKUP" else None
            for provider_id, standby in zip(shortlist.provider_ids, shortlist.standbys, strict=True)
        ),
        map(openings.get, shortlist.drone_ids),
        strict=True,
    )
    return np.array([numbers.setdefault(plan, len(numbers)) for plan in plans])
