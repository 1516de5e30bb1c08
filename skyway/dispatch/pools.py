"""Which requests may share a trip, and where it may be loaded."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from skyway.dispatch.planned_trip import Pool
from skyway.dispatch.problem import MAX_DESTINATIONS, FleetProblem, FleetRequest
from skyway.ids import StationId

#: The most shared trips that are considered. Our own choice: their estimates take half a second.
_MOST_POOLS: Final = 20_000

#: The most destinations of a shared trip. Our own choice: with more, estimates and plans are slow.
_MOST_DESTINATIONS: Final = 6


def pickups_of(requests: Sequence[FleetRequest]) -> tuple[StationId, ...]:
    """The stations where a trip of these requests may be loaded; none if they may not share it.

    A request alone is picked up at its source.
    """
    return (requests[0].source,) if len(requests) == 1 else _common_pickups(requests)


def _common_pickups(requests: Sequence[FleetRequest]) -> tuple[StationId, ...]:
    first, *others = requests
    return tuple(
        station_id
        for station_id in (first.source, *first.pickups)
        if all(station_id == each.source or station_id in each.pickups for each in others)
    )


def shared_pools(problem: FleetProblem) -> list[Pool]:
    """Sets of two and more requests that may share a trip, small sets first.

    All requests of a set allow pooling and have a common pickup, and the strongest drone model of
    the fleet can lift them together. The planner checks their windows later.
    """
    limit_kg = max(each.model.max_payload_kg for each in problem.drones)
    by_source: dict[StationId, list[Pool]] = {}
    by_pickup: dict[StationId, list[int]] = {}
    for number, request in enumerate(problem.requests):
        if request.pooling and request.mass_kg <= limit_kg:
            by_source.setdefault(request.source, []).append((number,))
            for station_id in (request.source, *request.pickups):
                by_pickup.setdefault(station_id, []).append(number)
    level = [pool for pools in by_source.values() for pool in pools]
    found: list[Pool] = []
    for _ in range(problem.most_pooled - 1):
        level = [
            larger
            for pool in level
            for larger in _enlarged(problem, pool, by_pickup, limit_kg=limit_kg)
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
    by_pickup: Mapping[StationId, Sequence[int]],
    *,
    limit_kg: float,
) -> Iterator[Pool]:
    """The pool with one more request, of a higher number."""
    members = [problem.requests[each] for each in pool]
    mass_kg = sum(each.mass_kg for each in members)
    following = {
        number
        for station_id in _common_pickups(members)
        for number in by_pickup[station_id]
        if number > pool[-1]
    }
    for number in sorted(following):
        larger = (*pool, number)
        if mass_kg + problem.requests[number].mass_kg <= limit_kg and _destinations(
            problem, larger
        ) <= min(_MOST_DESTINATIONS, MAX_DESTINATIONS):
            yield larger


def _destinations(problem: FleetProblem, pool: Sequence[int]) -> int:
    return len({one.destination for each in pool for one in problem.requests[each].packages})
