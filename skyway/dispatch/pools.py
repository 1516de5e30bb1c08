"""Which requests may share a trip."""

from collections.abc import Iterator, Sequence
from typing import Final

from skyway.dispatch.planned_trip import Pool
from skyway.dispatch.problem import MAX_DESTINATIONS, FleetProblem
from skyway.ids import StationId

#: The most shared trips that are considered. Our own choice: their estimates take half a second.
_MOST_POOLS: Final = 20_000

#: The most destinations of a shared trip. Our own choice: with more, estimates and plans are slow.
_MOST_DESTINATIONS: Final = 6


def shared_pools(problem: FleetProblem) -> list[Pool]:
    """Sets of two and more requests that may share a trip, small sets first.

    All requests of a set allow pooling and have the same pick-up, and the strongest drone model of
    the fleet can lift them together. The planner checks their windows later.
    """
    limit_kg = max(each.model.max_payload_kg for each in problem.drones)
    by_source: dict[StationId, list[int]] = {}
    for number, request in enumerate(problem.requests):
        if request.pooling and request.mass_kg <= limit_kg:
            by_source.setdefault(request.source, []).append(number)
    level: list[Pool] = [(each,) for numbers in by_source.values() for each in numbers]
    found: list[Pool] = []
    for _ in range(problem.most_pooled - 1):
        level = [
            larger
            for pool in level
            for larger in _enlarged(problem, pool, by_source, limit_kg=limit_kg)
        ]
        if len(found) + len(level) > _MOST_POOLS:
            break
        found += level
    return found


def waits_for_more(problem: FleetProblem, pool: Pool, *, most_wait_s: float) -> bool:
    """Whether a trip of these requests waits for other requests that may share it.

    It waits until it has as many requests as may share a trip, or until its oldest request is so
    old. The search knows no future requests, so the caller asks this before it begins a trip.
    """
    requests = [problem.requests[each] for each in pool]
    return (
        len(pool) < problem.most_pooled
        and all(each.pooling for each in requests)
        and min(each.known_s for each in requests) > -most_wait_s
    )


def _enlarged(
    problem: FleetProblem,
    pool: Pool,
    by_source: dict[StationId, list[int]],
    *,
    limit_kg: float,
) -> Iterator[Pool]:
    """The pool with one more request, of a higher number."""
    mass_kg = sum(problem.requests[each].mass_kg for each in pool)
    for number in by_source[problem.requests[pool[0]].source]:
        if number <= pool[-1]:
            continue
        larger = (*pool, number)
        if mass_kg + problem.requests[number].mass_kg <= limit_kg and _destinations(
            problem, larger
        ) <= min(_MOST_DESTINATIONS, MAX_DESTINATIONS):
            yield larger


def _destinations(problem: FleetProblem, pool: Sequence[int]) -> int:
    return len({one.destination for each in pool for one in problem.requests[each].packages})
