"""Which pads the trips of a fleet plan hold, while the plan is made trip by trip."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from skyway.dispatch.problem import FleetProblem
from skyway.ids import StationId
from skyway.planner.kernels.memory import Longs
from skyway.planner.pad_book import OPEN_MS, PadBook, booked_from_ms, booked_until_ms


class HeldPad(NamedTuple):
    """A pad that one drone holds in [start_ms, end_ms) of the problem's time."""

    station_id: StationId
    pad: int
    start_ms: int
    end_ms: int


class FleetPads:
    """The pads that are held, with a gap between two drones on one pad."""

    def __init__(self, problem: FleetProblem) -> None:
        self._network = problem.network
        self._gap_ms = booked_until_ms(problem.pad_gap_s)
        self._held: dict[StationId, list[HeldPad]] = {}
        self.hold(
            HeldPad(
                each.station_id,
                each.pad,
                booked_from_ms(each.start_s),
                OPEN_MS if each.end_s is None else booked_until_ms(each.end_s),
            )
            for each in problem.pad_reservations
        )

    def copy(self) -> "FleetPads":
        """A copy of these pads that can be changed by itself."""
        other = object.__new__(FleetPads)
        other._network, other._gap_ms = self._network, self._gap_ms
        other._held = {station_id: [*held] for station_id, held in self._held.items()}
        return other

    def hold(self, sessions: Iterable[HeldPad]) -> None:
        """Note that these sessions hold their pads."""
        for each in sessions:
            self._held.setdefault(each.station_id, []).append(each)

    def after(self, moment_ms: int) -> frozenset[HeldPad]:
        """The sessions that a trip from this moment on may meet."""
        return frozenset(
            each
            for held in self._held.values()
            for each in held
            if each.end_ms + self._gap_ms > moment_ms
        )

    def fitted(self, sessions: Sequence[HeldPad]) -> tuple[HeldPad, ...] | None:
        """The sessions of one drone, each on a pad that is free; None if one finds no pad."""
        found = []
        for each in sessions:
            pad = self._free_pad(each)
            if pad is None:
                return None
            found.append(each if pad == each.pad else each._replace(pad=pad))
        return tuple(found)

    def widened(self, session: HeldPad) -> Longs:
        """The session with the gap on both sides: station row, pad, from and until, ``(4,)``."""
        return np.array(
            [
                self._network.row_of[session.station_id],
                session.pad,
                max(-OPEN_MS, session.start_ms - self._gap_ms),
                min(OPEN_MS, session.end_ms + self._gap_ms),
            ],
            np.int64,
        )

    def book(self) -> PadBook:
        """All held pads with their gaps, as a pad book for the planner."""
        rows = [self.widened(each) for held in self._held.values() for each in held]
        columns = np.array(rows, np.int64).reshape(-1, 4).T
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


class Reserved:
    """Tracks which pads the planner's ledger has reserved, so that no part is reserved twice.

    Sessions with their gaps may overlap, and the ledger refuses overlapping reservations.
    """

    def __init__(self, given: PadBook) -> None:
        self._given: dict[tuple[int, int], list[tuple[int, int]]] = {}
        for row, pad, start_ms, end_ms in zip(
            given.station.tolist(),
            given.pad.tolist(),
            given.start_ms.tolist(),
            given.end_ms.tolist(),
            strict=True,
        ):
            self._given.setdefault((row, pad), []).append((start_ms, end_ms))
        self._now = self._copied()
        self.parts: list[list[int]] = []

    def clear(self) -> None:
        """Begin again with the reservations that were given."""
        self._now, self.parts = self._copied(), []

    def new_parts(self, session: Longs) -> Longs:
        """The parts of a session that are not reserved yet ``(k, 4)``; they count as reserved."""
        row, pad, from_ms, until_ms = session.tolist()
        held = self._now.setdefault((row, pad), [])
        parts = []
        for start_ms, end_ms in sorted(held):
            if end_ms <= from_ms:
                continue
            if start_ms >= until_ms:
                break
            if from_ms < start_ms:
                parts.append([row, pad, from_ms, start_ms])
            from_ms = max(from_ms, end_ms)
        if from_ms < until_ms:
            parts.append([row, pad, from_ms, until_ms])
        held += [(start_ms, end_ms) for _, _, start_ms, end_ms in parts]
        self.parts += parts
        return np.array(parts, np.int64).reshape(-1, 4)

    def _copied(self) -> dict[tuple[int, int], list[tuple[int, int]]]:
        return {key: [*held] for key, held in self._given.items()}
