"""The world in which plans are made: a network version, its reservations and its closures.

`compose_in` reads only the reservations that a plan needs. `ClosedAhead` says whether a landing or
a segment is closed at a given time.
"""

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from math import inf
from typing import Final, Self

import numpy as np

from skyway.delivery.plan import Plan, Recharge
from skyway.ids import HoldId, MissionId, StationId
from skyway.network.columns import Rows
from skyway.network.network import Network
from skyway.planner.airspace import ZoneReach
from skyway.planner.compose import DEFAULT_STRATEGY
from skyway.planner.problem import Problem
from skyway.planner.problem_parts import SegmentClosure, StationClosure
from skyway.runtime.sql.database import Database, Tx
from skyway.scheduling.trip import BookedPad
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.closures.closure import Closure
from skyway_composition.closures.conditions import Conditions
from skyway_composition.networks.prepared import PreparedNetwork, PreparedNetworks
from skyway_composition.networks.store import Present, share_current
from skyway_composition.pads.pad_snapshot import PadSnapshot
from skyway_composition.planning.solver_pool import SolverPool

#: How far around a request's places pads are read first, as a share of the distance between them.
#: Our own choice: most detours to recharge lie within this margin.
_FIRST_MARGIN: Final = 0.25

#: How often the box around the places is widened before the whole network is read.
_MOST_BOXES: Final = 3

#: From one moment until before another, milliseconds since 1970.
_Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class World:
    """The world of a plan; a transaction that stores the plan must check `still_holds`.

    The database itself checks reservations.
    """

    skyway: PreparedNetwork
    pads: PadSnapshot
    conditions: Conditions
    conditions_version: int

    @property
    def present(self) -> Present:
        """Version and conditions of the network, which must be unchanged when a plan is stored."""
        skyway = self.skyway
        return Present(skyway.network_id, skyway.version, self.conditions_version)

    def without(self, owners: Collection[MissionId | HoldId]) -> Self:
        """The same world, in which the pads of these missions and holds count as free."""
        return replace(self, pads=self.pads.without(owners))

    def anew(self) -> Self:
        """The same world, in which pads are read again."""
        return replace(self, pads=self.pads.anew())

    def instead(self, pads: Mapping[MissionId, Collection[BookedPad]]) -> Self:
        """The same world, in which these missions have reserved exactly these pads."""
        return replace(self, pads=self.pads.instead(pads))

    @classmethod
    async def around(
        cls, station_id: StationId, networks: PreparedNetworks, *, db: Database, after_ms: int
    ) -> Self | None:
        """The world of the network that has this station; None when no network has it."""
        present = await networks.present_around(station_id)
        return (
            None if present is None else await cls.at(present, networks, db=db, after_ms=after_ms)
        )

    @classmethod
    async def at(
        cls,
        present: Present,
        networks: PreparedNetworks,
        *,
        db: Database,
        after_ms: int,
        pad_gap_s: float | None = None,
    ) -> Self:
        """The world of a network at a version and conditions number that were just read.

        Reservations begin `pad_gap_s` early; None means the network's own gap.
        """
        skyway = await networks.version(present.network_id, present.version)
        number = present.conditions
        conditions = await skyway.conditions.numbered(number, db, after_ms=after_ms)
        pads = _pads(skyway, db, conditions, after_ms=after_ms, pad_gap_s=pad_gap_s)
        return cls(skyway, pads, conditions, number)

    @classmethod
    async def of(
        cls,
        skyway: PreparedNetwork,
        db: Database,
        *,
        after_ms: int,
        without: Collection[MissionId] = (),
        pad_gap_s: float | None = None,
        supposed: Sequence[Closure] = (),
    ) -> Self:
        """The network with the closures and reservations that end after a moment.

        The reservations of the missions `without` are left out. All others begin `pad_gap_s`
        early; None means the network's own gap. The `supposed` closures were not made: a dry run
        plans as if they were.
        """
        number, conditions = await skyway.conditions.read(db, after_ms=after_ms)
        if supposed:
            conditions = Conditions(conditions.network, (*conditions.closures, *supposed))
        pads = _pads(
            skyway,
            db,
            conditions,
            after_ms=after_ms,
            without=without,
            pad_gap_s=pad_gap_s,
        )
        return cls(skyway, pads, conditions, number)


def _pads(
    skyway: PreparedNetwork,
    db: Database,
    conditions: Conditions,
    *,
    after_ms: int,
    without: Collection[MissionId] = (),
    pad_gap_s: float | None = None,
) -> PadSnapshot:
    gap_s = skyway.settings.pad_gap_s if pad_gap_s is None else pad_gap_s
    return PadSnapshot(
        db,
        skyway.network_id,
        skyway.network,
        after_ms=after_ms,
        without=without,
        outages=conditions.pad_outages(after_ms),
        gap_ms=round(gap_s * 1000),
    )


async def still_holds(tx: Tx, world: World) -> bool:
    """Whether the network is as planned: nothing was published, closed or lifted since (I11).

    Nothing can change before `tx` ends. Reservations are not checked. A transaction with more
    locks calls this after it locks the delivery and before it locks drones.
    """
    now = await share_current(tx, world.skyway.network_id)
    return now == (world.skyway.version, world.conditions_version)


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


class ClosedAhead:
    """The closures and zones of a network from a moment on."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._stations: dict[StationId, list[_Span]] = defaultdict(list)
        self._segments: dict[tuple[StationId, StationId], list[_Span]] = defaultdict(list)

    @classmethod
    def of(cls, world: World, *, now_ms: int) -> Self:
        """All that is closed in a world, now or later."""
        closed = cls(world.skyway.network)
        closed.add(world.conditions.problem_closures(now_ms), start_ms=now_ms)
        closed.add_zones(world.skyway.airspace.reaches)
        return closed

    def add(self, closures: Iterable[StationClosure | SegmentClosure], *, start_ms: int) -> None:
        """Add closures whose seconds count from this moment."""
        for closure in closures:
            end_ms = inf if closure.end_s is None else start_ms + closure.end_s * 1000
            span = start_ms + closure.start_s * 1000, end_ms
            if isinstance(closure, StationClosure):
                self._stations[closure.station_id].append(span)
            else:
                self._segments[closure.from_id, closure.to_id].append(span)

    def add_zones(self, reaches: Iterable[ZoneReach]) -> None:
        """Add the zones of the network."""
        for reach in reaches:
            span = _ms(reach.zone.active_from, -inf), _ms(reach.zone.active_until, inf)
            for station_id in reach.stations:
                self._stations[station_id].append(span)
            for ends in reach.segments:
                self._segments[ends].append(span)

    def closes_landing(self, station_id: StationId, at_ms: float) -> bool:
        """Whether the station is closed at that moment, or no longer exists.

        Opening hours do not count: a drone that comes late lands, and waits on the ground.
        """
        if station_id not in self._network.stations:
            return True
        spans = self._stations.get(station_id, ())
        return any(start_ms <= at_ms < end_ms for start_ms, end_ms in spans)

    def is_shut(self, station_id: StationId, at_ms: float) -> bool:
        """Whether the station is closed by its opening hours at that moment."""
        hours = self._network.opening_hours.get(station_id)
        return hours is not None and not hours.is_open(ms_to_moment(int(at_ms)))

    def closes_segment(
        self, from_id: StationId, to_id: StationId, *, start_ms: float, end_ms: float
    ) -> bool:
        """Whether the segment is closed at some moment of that time, or no longer exists."""
        if from_id not in self._network.stations or not any(
            each.to_id == to_id for each in self._network.segments_from(from_id)
        ):
            return True
        spans = self._segments.get((from_id, to_id), ())
        return any(from_ms < end_ms and start_ms < until_ms for from_ms, until_ms in spans)

    def is_closed_for_good(self, station_id: StationId) -> bool:
        """Whether a station is closed without an end, or no longer exists."""
        spans = self._stations.get(station_id, ())
        exists = station_id in self._network.stations
        return not exists or any(end_ms == inf for _, end_ms in spans)


def _ms(moment: datetime | None, unknown: float) -> float:
    return unknown if moment is None else moment_to_ms(moment)
