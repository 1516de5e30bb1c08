"""The reservations of a network, read station by station when planning needs them."""

import asyncio
from collections.abc import Collection, Sequence
from typing import Final, Self

import numpy as np

from skyway.ids import HoldId, MissionId, NetworkId, StationId
from skyway.network.columns import Rows
from skyway.network.network import Network
from skyway.planner.pad_book import NO_RESERVATIONS, PadBook
from skyway.runtime.sql.database import Database
from skyway_composition.pads.store import PadHeld, booked_at, booked_everywhere

#: With more stations than this, all reservations of the network are read: that is faster.
_MOST_NAMED: Final = 5_000


class PadSnapshot:
    """The reservations of one network's stations that end after a moment.

    Each station is read once. The booking transaction finds out whether they have changed.

    Parameters
    ----------
    after_ms
        The moment, milliseconds since 1970.
    without
        Missions and holds whose pads count as free.
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
        without: Collection[MissionId | HoldId] = (),
        outages: Sequence[PadHeld] = (),
        gap_ms: int = 0,
    ) -> None:
        self._db = db
        self._network_id = network_id
        self._network = network
        self._after_ms = after_ms
        self._without = frozenset(without)
        self._is_read = np.zeros(len(network.row_of), np.bool_)
        self._outages = tuple(outages)
        self._gap_ms = gap_ms
        self._held: list[PadHeld] = []
        # A second caller waits here, so that it does not plan before the rows are read.
        self._reading = asyncio.Lock()
        #: The reservations read so far, in milliseconds since 1970.
        self.book: PadBook = self._book_of(()) if outages else NO_RESERVATIONS

    def without(self, owners: Collection[MissionId | HoldId]) -> Self:
        """The same reservations but those of these missions and holds, to be read anew."""
        return type(self)(
            self._db,
            self._network_id,
            self._network,
            after_ms=self._after_ms,
            without=self._without.union(owners),
            outages=self._outages,
            gap_ms=self._gap_ms,
        )

    def has_read(self, station_id: StationId) -> bool:
        """Whether this station has been read."""
        return bool(self._is_read[self._network.row_of[station_id]])

    async def read(self, rows: Rows) -> None:
        """Read the stations of these rows that have not been read."""
        async with self._reading:
            missing = rows[~self._is_read[rows]]
            if len(missing) > _MOST_NAMED:
                await self._read_all()
            elif len(missing):
                await self._read_at(missing)

    async def _read_all(self) -> None:
        async with self._db.read() as connection:
            self._held = await booked_everywhere(
                connection,
                self._network_id,
                moment_ms=self._after_ms,
                without=self._without,
            )
        self.book = self._book_of(self._held)
        self._is_read[:] = True

    async def _read_at(self, missing: Rows) -> None:
        ids = self._network.columns.station_ids
        async with self._db.read() as connection:
            self._held += await booked_at(
                connection,
                [ids[row] for row in missing.tolist()],
                moment_ms=self._after_ms,
                without=self._without,
            )
        self.book = self._book_of(self._held)
        self._is_read[missing] = True

    def _book_of(self, held: Sequence[PadHeld]) -> PadBook:
        row_of, pads = self._network.row_of, self._network.columns.pads
        early = ((*each[:2], each[2] - self._gap_ms, each[3]) for each in held)
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
