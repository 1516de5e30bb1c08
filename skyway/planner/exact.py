"""The proven best plan: label setting over stations and delivered sets, guided by lower bounds.

docs/reference/planner-method.md explains the method. How long to stay on a pad is decided only when
a flight needs the charge, so any amount can be charged and nothing is rounded to a grid. `kernels`
holds the compiled search, `exact_search` its memory; `exact_itinerary` turns the result into steps.
"""

from collections.abc import Sequence

from skyway.ids import StationId
from skyway.planner.exact_itinerary import itinerary_of
from skyway.planner.exact_proof import (
    closed_for_good,
    proof_of_infeasibility,
    unreachable_behind_closures,
)
from skyway.planner.exact_search import Ending, ExactSearch
from skyway.planner.exact_task import Method
from skyway.planner.findings import Findings, Strategy
from skyway.planner.itinerary import Itinerary
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort

#: Labels after which an unfinished search looks for any plan, so that there is one.
_PATIENCE_LABELS = 1 << 16

#: Factor by which the bound is raised to find any plan soon. Our own choice.
_HASTE = 3.0


def exact(situation: Situation, effort: Effort) -> Findings:
    """The plan that delivers earliest, with its proof; or the proof that there is none."""
    return _find(situation, effort, Method(), None)


def exact_with(method: Method, *, order: Sequence[StationId] | None = None) -> Strategy:
    """The exact search with another method, or for one order of the destinations.

    What another method or order finds is not proven to be the best of the problem.
    """
    return lambda situation, effort: _find(situation, effort, method, order)


def _find(
    situation: Situation, effort: Effort, method: Method, order: Sequence[StationId] | None
) -> Findings:
    closed = closed_for_good(situation)
    if closed is not None:
        return Findings(None, 0, infeasibility=closed)
    search = ExactSearch(situation, method=method, order=order)
    ending = search.run(effort, most_labels=min(_PATIENCE_LABELS, effort.room // 2))
    other = None
    if ending is Ending.PAUSED:
        hasty = ExactSearch(situation, method=method, order=order, weight=_HASTE)
        hasty.run(effort, most_labels=min(search.labels, effort.room // 2))
        other = _itinerary_of(situation, hasty)
        if other is not None:
            search.improve_on(other.delivered_s)
        elif (proof := unreachable_behind_closures(situation)) is not None:
            return Findings(None, search.stations_searched, infeasibility=proof)
        ending = search.run(effort, most_labels=effort.room)
    itinerary = _itinerary_of(situation, search) or other
    searched = search.stations_searched
    if itinerary is None and ending is Ending.EXHAUSTED:
        proof = proof_of_infeasibility(situation, effort)
        return Findings(None, searched, infeasibility=proof)
    bound_s = search.lower_bound_s if method == Method() and order is None else None
    return Findings(itinerary, searched, _at_most(bound_s, itinerary))


def _itinerary_of(situation: Situation, search: ExactSearch) -> Itinerary | None:
    acts = search.best_acts()
    return None if acts is None else itinerary_of(situation, acts)


def _at_most(bound_s: float | None, itinerary: Itinerary | None) -> float | None:
    """The bound, at most the plan's own time: sums of floats may make it a little later."""
    if bound_s is None or itinerary is None:
        return bound_s
    return min(bound_s, itinerary.delivered_s)
