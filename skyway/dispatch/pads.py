"""Which pads the trips of a fleet plan hold, as it is made trip by trip."""

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from skyway.ids import StationId
from skyway.network.network import Network
from skyway.planner.pad_book import OPEN_MS, PadBook, booked_from_ms, booked_until_ms
from skyway.planner.problem_parts import PadReservation

#: Before any plan, milliseconds.
_LONG_AGO_MS: Final = -OPEN_MS


class HeldPad(NamedTuple):
    """A pad that one drone holds in [start_ms, end_ms) of the problem's time."""

    station_id: StationId
    pad: int
    start_ms: int
    end_ms: int


class PadLedger:
    """The pads that are held; between two drones on one pad lies the gap."""

    def __init__(self, network: Network, given: Iterable[PadReservation], *, gap_ms: int) -> None:
        self._network = network
        self._gap_ms = gap_ms
        self._held: dict[StationId, list[HeldPad]] = {}
        self.hold(
            HeldPad(
                each.station_id,
                each.pad,
                booked_from_ms(each.start_s),
                OPEN_MS if each.end_s is None else booked_until_ms(each.end_s),
            )
            for each in given
        )

    def copy(self) -> "PadLedger":
        """A ledger that changes by itself from now on."""
        other = PadLedger(self._network, (), gap_ms=self._gap_ms)
        other._held = {station: [*held] for station, held in self._held.items()}
        return other

    def hold(self, sessions: Iterable[HeldPad]) -> None:
        """Note that these sessions hold their pads."""
        for each in sessions:
            self._held.setdefault(each.station_id, []).append(each)

    def fitted(self, sessions: Sequence[HeldPad]) -> tuple[HeldPad, ...] | None:
        """The sessions of one drone, each on a pad that is free; None if one finds no pad."""
        found = []
        for each in sessions:
            pad = self._free_pad(each)
            if pad is None:
                return None
            found.append(each if pad == each.pad else each._replace(pad=pad))
        return tuple(found)

    def book(self, *, from_ms: int) -> PadBook:
        """What is held after a moment, widened by the gap, as the planner reads it."""
        gap_ms, row_of = self._gap_ms, self._network.row_of
        entries = [
            (
                row_of[each.station_id],
                each.pad,
                max(_LONG_AGO_MS, each.start_ms - gap_ms),
                min(OPEN_MS, each.end_ms + gap_ms),
            )
            for held in self._held.values()
            for each in held
            if each.end_ms + gap_ms > from_ms
        ]
        columns = np.array(entries, np.int64).reshape(-1, 4).T
        return PadBook.of_arrays(
            station=columns[0], pad=columns[1], start_ms=columns[2], end_ms=columns[3]
        )

    def _free_pad(self, session: HeldPad) -> int | None:
        """The session's own pad if it is free, else the first free pad of the station."""
        held = self._held.get(session.station_id)
        if held is None:
            return session.pad
        gap_ms = self._gap_ms
        from_ms, until_ms = session.start_ms - gap_ms, session.end_ms + gap_ms
        taken = {each.pad for each in held if each.start_ms < until_ms and from_ms < each.end_ms}
        if session.pad not in taken:
            return session.pad
        pads = self._network.stations[session.station_id].pads
        return next((pad for pad in range(pads) if pad not in taken), None)
