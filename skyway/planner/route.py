"""A route: the segments that a drone flies, stretch after stretch, and where it hands over.

A route has no times: the itinerary decides when to wait and where to recharge.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from skyway.ids import StationId
from skyway.network.network import Segment
from skyway.planner.situation import Situation
from skyway.planner.subnetwork import Subnetwork


@dataclass(frozen=True, slots=True)
class Stretch:
    """A flight without segments yet: its target, its load, and the part of the network to use.

    `keep_off` are destinations whose packages are on board: flying there would deliver them.
    """

    target: StationId
    load_kg: float
    subnetwork: Subnetwork
    keep_off: frozenset[StationId] = frozenset()


@dataclass(frozen=True, slots=True)
class Leg:
    """A stretch whose segments are chosen."""

    target: StationId
    load_kg: float
    segments: tuple[Segment, ...]


Route = tuple[Leg, ...]


def stretches(
    situation: Situation,
    order: Sequence[StationId],
    *,
    subnetwork: Subnetwork,
    approach: Subnetwork,
) -> tuple[Stretch, ...]:
    """What has to be flown for this order: the approach if there is one, then each destination."""
    problem = situation.problem
    flights = []
    if problem.start_station_id != problem.source:
        flights.append(Stretch(problem.source, 0.0, approach))
    for number, target in enumerate(order):
        undelivered = frozenset(order[number:])
        flights.append(
            Stretch(target, situation.load_kg(undelivered), subnetwork, undelivered - {target})
        )
    return tuple(flights)
