"""Compose among all reservations, but read only the reservations that the plan needs."""

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

#: How far around a request's places pads are read first, as a share of the distance between them.
#: Our own choice: most detours to recharge lie within this margin.
_FIRST_MARGIN: Final = 0.25

#: How often the box around the places is widened before the whole network is read.
_MOST_BOXES: Final = 3


async def compose_in(solver: SolverPool, world: World, problem: Problem) -> Plan:
    """The plan of a problem with a `start_at`, among the reservations of this world.

    A problem with fewer reservations is easier. If its plan charges only at stations that were
    read, the plan and its proof hold for the whole problem. If it has no plan, the whole problem
    has none. In all other cases more stations are read and the problem is composed again. Only
    the exact search finds the same plan either way; for other strategies all stations are read.
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
        unread = {each for each in _charging_stations(plan) if not world.pads.has_read(each)}
        if not unread:
            return plan
        places |= unread
        margin *= 2
        boxes -= 1


def _charging_stations(plan: Plan) -> Iterable[StationId]:
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
