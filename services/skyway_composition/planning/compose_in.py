"""Composing among everybody's reservations, of which no more are read than the plan needs."""

from collections.abc import Iterable
from typing import Final

import numpy as np

from skyway.delivery.plan import Plan, Recharge
from skyway.ids import StationId
from skyway.network.columns import Rows
from skyway.network.network import Network
from skyway.planner.compose import DEFAULT_STRATEGY
from skyway.planner.problem import Problem
from skyway.units import moment_to_ms
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.world import World

#: How far around a request's places pads are read first, as a share of the way between them.
#: Our own choice: most detours to recharge lie within.
_FIRST_MARGIN: Final = 0.25

#: How often the box around the places is widened before the whole network is read.
_MOST_BOXES: Final = 3


async def compose_in(solver: SolverPool, world: World, problem: Problem) -> Plan:
    """The plan of a problem, which has a `start_at`, among the reservations of this world.

    With reservations left out the problem only gets easier: a plan that charges at none of the
    stations left out is a plan of the whole problem too, and proven as far as the easier one is;
    and what the easier one proves impossible is. Any other plan is made again with more stations
    read. Only the exact search finds the same plan either way, so all is read for the others.
    """
    network = world.skyway.network
    start_ms = 0 if problem.start_at is None else moment_to_ms(problem.start_at)
    places = {problem.source, problem.start_station_id}
    places.update(package.destination for package in problem.packages)
    margin = _FIRST_MARGIN
    boxes = _MOST_BOXES if problem.strategy in (None, DEFAULT_STRATEGY) else 0
    while True:
        around = _rows_around(network, places, margin) if boxes > 0 else _all_rows(network)
        await world.pads.read(around)
        plan = await solver.compose(
            problem,
            airspace=world.skyway.airspace,
            hierarchy=world.skyway.hierarchy,
            booked=world.pads.book.seen_from(start_ms),
        )
        unread = {each for each in _charged_at(plan) if not world.pads.has_read(each)}
        if not unread:
            return plan
        places |= unread
        margin *= 2
        boxes -= 1


def _charged_at(plan: Plan) -> Iterable[StationId]:
    return (step.station_id for step in plan.steps if isinstance(step, Recharge))


def _rows_around(network: Network, places: Iterable[StationId], margin: float) -> Rows:
    """The stations in the box around these places, with a margin as a share of its larger side."""
    columns = network.columns
    rows = [network.row_of[place] for place in places]
    longitude_deg, latitude_deg = columns.longitude_deg[rows], columns.latitude_deg[rows]
    west, east = longitude_deg.min(), longitude_deg.max()
    south, north = latitude_deg.min(), latitude_deg.max()
    more_deg = margin * max(east - west, north - south)
    is_near = (
        (columns.longitude_deg >= west - more_deg)
        & (columns.longitude_deg <= east + more_deg)
        & (columns.latitude_deg >= south - more_deg)
        & (columns.latitude_deg <= north + more_deg)
    )
    return np.flatnonzero(is_near).astype(np.int32)


def _all_rows(network: Network) -> Rows:
    return np.arange(len(network.row_of), dtype=np.int32)
