"""Good plans soon: searches that leave out most labels, or raise the bound, and prove nothing."""

from collections.abc import Sequence
from dataclasses import dataclass

from skyway.ids import StationId
from skyway.planner.exact_itinerary import itinerary_of
from skyway.planner.exact_search import LAYERS, Ending, ExactSearch
from skyway.planner.exact_task import Method
from skyway.planner.itinerary import Itinerary
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort

#: The bound is multiplied by the first factor to find a plan soon. Where a narrow search finds no
#: better plan, it is multiplied by the others, one after another (Likhachev, Gordon and Thrun 2003,
#: ARA*). Our own choice.
_FACTORS = (5.0, 3.0, 2.0, 1.7, 1.5, 1.3)

#: The most labels of a search before a plan is found, and of a search for a better plan.
_LABELS_FOR_ANY_PLAN = 1 << 16
_LABELS_FOR_A_BETTER_PLAN = 1 << 15

#: The width of the first narrow search, and the least width that is worth trying. Our own choice.
_WIDTH = 64
_LEAST_WIDTH = 16

#: A narrow search makes about so many labels, and so many for each that it may take from the queue.
#: Measured where pads are scarce.
_LABELS_OF_A_PLAN = 2_000
_LABELS_PER_TAKEN = 1.25


@dataclass(frozen=True, slots=True)
class Haste:
    """Searches for good plans of one situation, within an effort."""

    situation: Situation
    effort: Effort
    method: Method
    order: Sequence[StationId] | None

    def plan(self) -> Itinerary | None:
        """The best plan that a narrow search finds, or searches with raised bounds; or None."""
        best: Itinerary | None = None
        for factor in _FACTORS:
            hasty = ExactSearch(self.situation, method=self.method, order=self.order, weight=factor)
            if best is None:
                most_labels = min(_LABELS_FOR_ANY_PLAN, self.effort.room * 3 // 4)
            else:
                hasty.improve_on(best.delivered_s)
                most_labels = min(_LABELS_FOR_A_BETTER_PLAN, self.effort.room * 15 // 16)
            ending = hasty.run(self.effort, most_labels=most_labels)
            best = earlier(best, itinerary_found(self.situation, hasty))
            if factor == _FACTORS[0]:
                width = min(_WIDTH, _width_for(self.effort.room * 15 // 16))
                better = self.better_plan(best, width=width)
                if better is not best:
                    return better
            if ending is Ending.PAUSED or self.effort.is_over:
                # A smaller factor would need even more labels.
                break
        return best

    def better_plan(self, best: Itinerary | None, *, width: int) -> Itinerary | None:
        """The best plan of a search of this width, if it is better than the best so far.

        There is no such search where there is no room for its labels, or the effort is over.
        """
        room = self.effort.room * 15 // 16
        if self.effort.is_over or not _LEAST_WIDTH <= width <= _width_for(room):
            return best
        narrow = ExactSearch(self.situation, method=self.method, order=self.order, width=width)
        if best is not None:
            narrow.improve_on(best.delivered_s)
        while room > 0:
            # Where the labels run out, a narrower rest may still reach the last delivery.
            labels = room - room // 4
            ending = narrow.run(self.effort, most_labels=labels)
            if ending is not Ending.PAUSED or self.effort.is_over:
                break
            room -= labels
            width //= 2
            narrow.narrow_to(width)
        return earlier(best, itinerary_found(self.situation, narrow))


def itinerary_found(situation: Situation, search: ExactSearch) -> Itinerary | None:
    """The best plan that this search found."""
    acts = search.best_acts()
    return None if acts is None else itinerary_of(situation, acts)


def earlier(one: Itinerary | None, other: Itinerary | None) -> Itinerary | None:
    """The earlier one of two plans, the first if both are as early."""
    if one is None or other is None:
        return one or other
    return other if other.delivered_s < one.delivered_s else one


def _width_for(labels: int) -> int:
    """The width of a narrow search that makes about so many labels."""
    return int((labels - _LABELS_OF_A_PLAN) / (LAYERS * _LABELS_PER_TAKEN))
