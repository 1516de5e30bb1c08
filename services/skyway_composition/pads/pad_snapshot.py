"""The reservations of a network, read station by station when planning needs them."""

import asyncio
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from copy import copy
from typing import Final, Self

import numpy as np

from skyway.ids import HoldId, MissionId, NetworkId, StationId
from skyway.network.columns import Rows
from skyway.network.network import Network
from skyway.planner.pad_book import NO_RESERVATIONS, PadBook
from skyway.runtime.sql.database import Database
from skyway.scheduling.trip import BookedPad
from skyway_composition.pads.store import PadHeld, PadHeldBy, booked_at, booked_everywhere

#: With more stations than this, all reservations of the network are read: that is faster.
_MOST_NAMED: Final = 5_000


class _PadsRead:
    """The reservations that were read so far; all snapshots made from one share them."""

    def __init__(
        self, db: Database, network_id: NetworkId, network: Network, *, after_ms: int
    ) -> None:
        self._db = db
        self._network_id = network_id
        self._network = network
        self._after_ms = after_ms
        # A second caller waits here, so that it does not plan before the rows are read.
        self._reading = asyncio.Lock()
        self.is_read = np.zeros(len(network.row_of), np.bool_)
        self.held: list[PadHeldBy] = []

    def anew(self) -> "_PadsRead":
        """The same with nothing read."""
        return _PadsRead(self._db, self._network_id, self._network, after_ms=self._after_ms)

    async def read(self, rows: Rows) -> None:
        """Read the stations of these rows that have not been read."""
        async with self._reading:
            missing = rows[~self.is_read[rows]]
            if len(missing) > _MOST_NAMED:
                await self._read_all()
            elif len(missing):
                await self._read_at(missing)

    async def _read_all(self) -> None:
        async with self._db.read() as connection:
            self.held = await booked_everywhere(
                connection, self._network_id, moment_ms=self._after_ms
            )
        self.is_read[:] = True

    async def _read_at(self, missing: Rows) -> None:
        ids = self._network.columns.station_ids
        station_ids = [ids[row] for row in missing.tolist()]
        async with self._db.read() as connection:
            self.held += await booked_at(connection, station_ids, moment_ms=self._after_ms)
        self.is_read[missing] = True


class PadSnapshot:
    """The reservations of one network's stations that end after a moment.

    Each station is read once. The booking transaction finds out whether they have changed.

    Parameters
    ----------
    after_ms
        The moment, milliseconds since 1970.
    outages
        Pads that are out of order, and when; an end of `OPEN_MS` means no end.
    gap_ms
        How long a pad must be free before a reservation. The gap after a reservation is part of
        the reservation.
    """

    def __init__(
        self,
        db: Database,
        network_id: NetworkId,
        network: Network,
        *,
        after_ms: int,
        outages: Sequence[PadHeld] = (),
        gap_ms: int = 0,
    ) -> None:
        self._network = network
        self._outages, self._gap_ms = tuple(outages), gap_ms
        self._begin(_PadsRead(db, network_id, network, after_ms=after_ms), frozenset(), {})

    def _begin(
        self,
        read: _PadsRead,
        without: frozenset[MissionId | HoldId],
        instead: Mapping[MissionId, Collection[BookedPad]],
    ) -> Self:
        """Begin with these reservations, which may have been read for another snapshot."""
        self._read, self._instead = read, dict(instead)
        self._without = without.union(instead)
        #: The stations whose reservations are in `book`.
        self._is_known = np.zeros(len(self._network.row_of), np.bool_)
        #: The reservations known so far, in milliseconds since 1970.
        self.book: PadBook = self._book_of(()) if self._outages or instead else NO_RESERVATIONS
        return self

    def without(self, owners: Collection[MissionId | HoldId]) -> Self:
        """The same reservations but those of these missions and holds."""
        instead = {key: pads for key, pads in self._instead.items() if key not in owners}
        return copy(self)._begin(self._read, self._without.union(owners), instead)

    def instead(self, pads: Mapping[MissionId, Collection[BookedPad]]) -> Self:
        """The same reservations as if these missions had exactly these pads."""
        return copy(self)._begin(self._read, self._without, {**self._instead, **pads})

    def anew(self) -> Self:
        """The same reservations, to be read again."""
        return copy(self)._begin(self._read.anew(), self._without, self._instead)

    def holders(self, *, from_ms: int, until_ms: int) -> frozenset[str]:
        """The missions and holds that have pads for some of this time, where none is free always.

        Only at stations that were read, here or in a snapshot that shares what was read.
        """
        row_of, pads = self._network.row_of, self._network.columns.pads
        taken: dict[StationId, set[int]] = defaultdict(set)
        holding: dict[StationId, set[str]] = defaultdict(set)
        for station_id, pad, start_ms, end_ms, owner in self._read.held:
            if start_ms < until_ms and from_ms < end_ms:
                taken[station_id].add(pad)
                holding[station_id].add(owner)
        for station_id, pad, start_ms, end_ms in self._outages:
            if start_ms < until_ms and from_ms < end_ms:
                taken[station_id].add(pad)
        return frozenset().union(
            *(
                owners
                for station_id, owners in holding.items()
                if station_id in row_of and len(taken[station_id]) >= pads[row_of[station_id]]
            )
        )

    def has_read(self, station_id: StationId) -> bool:
        """Whether the reservations of this station are in `book`."""
        return bool(self._is_known[self._network.row_of[station_id]])

    async def read(self, rows: Rows) -> None:
        """Read the stations of these rows that have not been read."""
        if self._is_known[rows].all():
            return
        await self._read.read(rows)
        self.book = self._book_of(self._read.held)
        self._is_known = self._read.is_read.copy()

    def _book_of(self, held: Sequence[PadHeldBy]) -> PadBook:
        row_of, pads = self._network.row_of, self._network.columns.pads
        early = [
            (station_id, pad, start_ms - self._gap_ms, end_ms)
            for station_id, pad, start_ms, end_ms, owner in held
            if owner not in self._without
        ]
        early += [
            (each.station_id, each.pad, each.start_ms - self._gap_ms, each.end_ms)
            for own in self._instead.values()
            for each in own
        ]
        # Left out: stations and pads that this version of the network does not have.
        entries = [
            (row, pad, start_ms, end_ms)
            for station_id, pad, start_ms, end_ms in (*early, *self._outages)
            if (row := row_of.get(station_id)) is not None and pad < pads[row]
        ]
        columns = np.array(entries, np.int64).reshape(-1, 4).T
        return PadBook.of_arrays(
            station=columns[0], pad=columns[1], start_ms=columns[2], end_ms=columns[3]
        )
