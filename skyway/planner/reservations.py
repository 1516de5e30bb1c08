"""Pad reservations as columns: how long lists of them are read and kept.

Reading by the column takes a fifth of the time of reading one by one. A list that holds a fault, or
something unusual, is read one by one: that reader decides, and names the fault.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Any, Self, overload

import numpy as np
import numpy.typing as npt
from pydantic import (
    Field,
    GetPydanticSchema,
    ValidatorFunctionWrapHandler,
    WrapSerializer,
    WrapValidator,
)

from skyway.ids import StationId
from skyway.network import column_fields
from skyway.network.column_fields import Doubtful
from skyway.network.columns import Floats, Rows
from skyway.network.network import MAX_PADS, Network
from skyway.planner.problem_parts import MAX_HELD, MAX_SECONDS, PadReservation
from skyway.units import TIME_TOLERANCE_S

#: Up to this length, reading one by one is as fast.
_FEW = 32

_MISSING = object()

#: The station and the pad of a reservation, its start and its end in seconds; inf without an end.
HeldSpan = tuple[StationId, int, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class ReservationColumns(Sequence[PadReservation]):
    """Reservations as columns, in the order of the document; it makes those that are asked for.

    Parameters
    ----------
    station_ids
        The different stations.
    station
        ``(n,)`` int32, the place of each reservation's station in `station_ids`.
    pad
        ``(n,)`` int32.
    start_s, end_s
        ``(n,)`` float64, seconds; an end is inf where there is none.
    """

    station_ids: tuple[StationId, ...]
    station: Rows
    pad: Rows
    start_s: Floats
    end_s: Floats

    @classmethod
    def of(cls, reservations: Iterable[PadReservation]) -> "ReservationColumns":
        """The columns of these reservations."""
        if isinstance(reservations, ReservationColumns):
            return reservations
        each = list(reservations)
        return cls.numbered(
            [one.station_id for one in each],
            pad=np.array([one.pad for one in each], np.int32),
            start_s=np.array([one.start_s for one in each], np.float64),
            end_s=np.array(
                [math.inf if one.end_s is None else one.end_s for one in each], np.float64
            ),
        )

    @classmethod
    def numbered(
        cls, station_ids: Sequence[StationId], *, pad: Rows, start_s: Floats, end_s: Floats
    ) -> Self:
        """The columns of reservations with these stations, one for each reservation."""
        number_of = {one: number for number, one in enumerate(dict.fromkeys(station_ids))}
        numbers = np.fromiter(map(number_of.__getitem__, station_ids), np.int32, len(station_ids))
        return cls(tuple(number_of), numbers, pad, start_s, end_s)

    def rows(self, network: Network) -> npt.NDArray[np.int64]:
        """The row of each reservation's station, ``(n,)``; -1 where the network has none."""
        row_of = network.row_of
        return np.array([row_of.get(one, -1) for one in self.station_ids], np.int64)[self.station]

    def fits(self, network: Network) -> bool:
        """Whether every pad exists, and no pad is reserved twice at a time.

        Also False in some cases in which reservations overlap by no more than the tolerance.
        """
        rows = self.rows(network)
        if (rows < 0).any() or (self.pad >= network.columns.pads[rows]).any():
            return False
        if (self.end_s <= self.start_s).any():
            return False
        pads = rows * MAX_PADS + self.pad
        order = order_of_pads(pads, self.start_s)
        pads, starts_s, ends_s = pads[order], self.start_s[order], self.end_s[order]
        overlaps = starts_s[1:] < ends_s[:-1] - TIME_TOLERANCE_S
        # As long as a later one also ends later, only neighbours can overlap.
        is_doubtful = overlaps | (ends_s[1:] < ends_s[:-1])
        return not (is_doubtful & (pads[1:] == pads[:-1])).any()

    def spans_at(self, stations: AbstractSet[StationId]) -> Iterator[HeldSpan]:
        """The reservations of these stations, in order."""
        is_asked = np.array([one in stations for one in self.station_ids], np.bool_)
        rows = np.flatnonzero(is_asked[self.station])
        station_ids = map(self.station_ids.__getitem__, self.station[rows].tolist())
        columns = (each[rows].tolist() for each in (self.pad, self.start_s, self.end_s))
        return zip(station_ids, *columns, strict=True)

    def __len__(self) -> int:
        return len(self.station)

    @overload
    def __getitem__(self, index: int) -> PadReservation: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[PadReservation, ...]: ...
    def __getitem__(self, index: int | slice) -> PadReservation | tuple[PadReservation, ...]:
        if isinstance(index, slice):
            return tuple(self[row] for row in range(*index.indices(len(self))))
        end_s = float(self.end_s[index])
        return PadReservation(
            station_id=self.station_ids[self.station[index]],
            pad=int(self.pad[index]),
            start_s=float(self.start_s[index]),
            end_s=None if end_s == math.inf else end_s,
        )

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash(tuple(self))


def order_of_pads(
    pads: npt.NDArray[np.int64], starts: npt.NDArray[np.integer] | Floats
) -> npt.NDArray[np.int64]:
    """The order by pad, then start; `pads` has a number for each pad of the network."""
    order = np.argsort(pads, kind="stable")
    pads, starts = pads[order], starts[order]
    # Most documents list the reservations of a pad in the order of time.
    if ((starts[1:] < starts[:-1]) & (pads[1:] == pads[:-1])).any():
        return order[np.lexsort((starts, pads))]
    return order


def spans_at(
    reservations: Sequence[PadReservation], stations: AbstractSet[StationId]
) -> Iterator[HeldSpan]:
    """The reservations of these stations, in order."""
    if isinstance(reservations, ReservationColumns):
        return reservations.spans_at(stations)
    return (
        (one.station_id, one.pad, one.start_s, math.inf if one.end_s is None else one.end_s)
        for one in reservations
        if one.station_id in stations
    )


def _read_by_column(
    value: Any,  # any JSON value
    read_one_by_one: ValidatorFunctionWrapHandler,
) -> Any:
    if isinstance(value, ReservationColumns):
        return value
    if type(value) is list and _FEW < len(value) <= MAX_HELD:
        with suppress(Doubtful):
            return _columns(value)
    return read_one_by_one(value)


def _columns(objects: list[Any]) -> ReservationColumns:  # any JSON values
    station_ids, pads, starts = column_fields.members(objects, "station_id", "pad", "start_s")
    column_fields.texts_or_none(station_ids)
    column_fields.identifiers(tuple(dict.fromkeys(station_ids)))
    ends = [each.get("end_s", _MISSING) for each in objects]
    missing = ends.count(_MISSING)
    if sum(map(len, objects)) != 4 * len(objects) - missing:
        raise Doubtful
    return ReservationColumns.numbered(
        station_ids,
        pad=column_fields.whole_numbers(pads, low=0, high=MAX_PADS - 1).astype(np.int32),
        start_s=column_fields.numbers(starts, low=-MAX_SECONDS, high=MAX_SECONDS),
        end_s=_ends_s([None if each is _MISSING else each for each in ends] if missing else ends),
    )


def _ends_s(values: list[Any]) -> Floats:  # any JSON values
    """The ends; inf for null."""
    if None not in values:
        return column_fields.numbers(values, low=-MAX_SECONDS, high=MAX_SECONDS)
    is_given = [value is not None for value in values]
    ends_s = np.full(len(values), math.inf)
    given = [value for value in values if value is not None]
    ends_s[is_given] = column_fields.numbers(given, low=-MAX_SECONDS, high=MAX_SECONDS)
    return ends_s


#: Reservations of a problem: a tuple, or columns if there are many. A long list reports only its
#: first fault.
PadReservations = Annotated[
    Sequence[PadReservation],
    GetPydanticSchema(lambda _type, schema_of: schema_of(tuple[PadReservation, ...])),
    Field(max_length=MAX_HELD),
    WrapValidator(_read_by_column),
    WrapSerializer(lambda value, write: write(tuple(value))),
]
