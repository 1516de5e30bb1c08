"""Weather: how much longer flights take, and how much more energy they use, by segment and period.

A drone flies with constant airspeed and power. So wind multiplies the time of a flight over a
segment, and the energy of the flight in the same proportion; `energy_factor` is what the energy
rises by beside that. The weather of a flight over one segment is that of the period in which this
flight begins. Outside all periods, and on segments that are not named, the air is still.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, islice
from typing import Any, Final, NamedTuple

import numpy as np
from pydantic import GetCoreSchemaHandler, ValidationInfo, ValidatorFunctionWrapHandler
from pydantic_core import core_schema

from skyway.errors import FieldFault
from skyway.network.network import Network
from skyway.planner.kernels.memory import Floats, Longs
from skyway.planner.weather_document import (
    MAX_FAULTS,
    WeatherDocument,
    WeatherPeriod,
    contradictions,
    refuse_too_many_factors,
)


class Air(NamedTuple):
    """What the air multiplies a flight's time by, and beside that the energy."""

    time_factor: float
    energy_factor: float


STILL_AIR: Final = Air(1.0, 1.0)


# Without slots: what is derived is made when it is first read.
@dataclass(frozen=True, eq=False)
class Weather:
    """The factors of some segments of a network, in periods that follow one another.

    Parameters
    ----------
    segment
        ``(n,)`` int64, rows of the network's segments, rising.
    edges_s
        ``(p + 1,)``, where the periods begin, and last where they end; seconds since the start.
    time_factor, energy_factor
        ``(p, n)``, row after row; a time factor of inf closes the segment.
    faults
        What is wrong with the document. Then there are no factors, and no problem accepts this.

    Notes
    -----
    Periods are numbered from 1. Number 0 is the still air before them, p + 1 that after them.
    """

    network: Network
    segment: Longs
    edges_s: Floats
    time_factor: Floats
    energy_factor: Floats
    faults: tuple[FieldFault, ...] = ()

    @classmethod
    def of(cls, network: Network, document: WeatherDocument) -> "Weather":
        """The weather that a document describes, or the faults of the document."""
        segment = segment_rows(network, document.segments)
        faults = tuple(islice(contradictions(document, segment), MAX_FAULTS))
        if faults:
            nothing = np.empty((0, 0))
            return cls(network, segment[:0], np.empty(0), nothing, nothing, faults)
        order = np.argsort(segment)
        periods, shape = document.periods, (len(document.periods), len(segment))
        time_factor, energy_factor = np.empty(shape), np.ones(shape)
        for number, period in enumerate(periods):
            time_factor[number] = np.array(period.time_factors, np.float64)
            if period.energy_factors:
                energy_factor[number] = period.energy_factors
        # `null` became NaN.
        time_factor[np.isnan(time_factor)] = math.inf
        last_s = periods[-1].end_s
        edges_s = [*(one.start_s for one in periods), math.inf if last_s is None else last_s]
        return cls(
            network,
            segment[order],
            np.array(edges_s, np.float64),
            np.ascontiguousarray(time_factor[:, order]),
            np.ascontiguousarray(energy_factor[:, order]),
        )

    def shifted(self, by_s: float) -> "Weather":
        """The same weather by a clock that is ahead by so many seconds."""
        moved = replace(self, edges_s=self.edges_s + by_s)
        # The least factors of the periods do not depend on the clock.
        moved.__dict__["_least_time"] = self._least_time
        moved.__dict__["_least_energy"] = self._least_energy
        return moved

    def document(self) -> WeatherDocument:
        """The same as a document."""
        columns, last_s = self.network.columns, float(self.edges_s[-1])
        ends = (columns.from_row[self.segment], columns.to_row[self.segment])
        rows = zip(ends[0].tolist(), ends[1].tolist(), strict=True)
        ends_s = [*self.edges_s[1:-1].tolist(), None if last_s == math.inf else last_s]
        return WeatherDocument(
            segments=tuple((columns.station_ids[a], columns.station_ids[b]) for a, b in rows),
            periods=tuple(
                WeatherPeriod(
                    start_s=float(self.edges_s[number]),
                    end_s=ends_s[number],
                    time_factors=tuple(
                        None if one == math.inf else one
                        for one in self.time_factor[number].tolist()
                    ),
                    energy_factors=tuple(self.energy_factor[number].tolist()),
                )
                for number in range(len(ends_s))
            ),
        )

    @cached_property
    def closes_some(self) -> bool:
        """Whether a segment is closed in some period."""
        return bool(np.isinf(self.time_factor).any())

    def least_time_factor(self, *, until_s: float) -> Floats:
        """``(n,)``, the least of each segment for flights that begin from 0 to this moment."""
        met = self._met(until_s)
        if met not in self._least_time:
            least = self.time_factor[met[0] : met[1]].min(axis=0, initial=math.inf)
            self._least_time[met] = np.minimum(least, 1.0) if met[2] else least
        return self._least_time[met]

    def least_energy_factor(self, *, until_s: float) -> float:
        """The least of all segments, named or not, for flights that begin until this moment."""
        first, end, is_still = self._met(until_s)
        has_all = len(self.segment) == len(self.network.columns.length_m)
        least = min(self._least_energy[first:end], default=1.0)
        return least if has_all and not is_still else min(least, 1.0)

    def _met(self, until_s: float) -> tuple[int, int, bool]:
        """The rows of the periods that begin by this moment and end after 0; if still air too."""
        first, last = self.period_at(0.0), self.period_at(until_s)
        count = len(self.time_factor)
        return max(first - 1, 0), min(last, count), first == 0 or last > count

    @cached_property
    def _least_time(self) -> dict[tuple[int, int, bool], Floats]:
        return {}

    @cached_property
    def _least_energy(self) -> list[float]:
        if not len(self.segment):
            return [1.0] * len(self.energy_factor)
        return [float(row.min()) for row in self.energy_factor]

    def period_at(self, at_s: float) -> int:
        """The number of the period that holds this moment."""
        return int(np.searchsorted(self.edges_s, at_s, side="right"))

    def end_of_period(self, at_s: float) -> float:
        """The end of the period that holds this moment; inf for the still air after all."""
        period = self.period_at(at_s)
        return float(self.edges_s[period]) if period < len(self.edges_s) else math.inf

    def air(self, segment: int, period: int) -> Air:
        """The air of a segment, by its row, in a period; an infinite time closes the segment."""
        column = int(np.searchsorted(self.segment, segment))
        is_named = column < len(self.segment) and self.segment[column] == segment
        if not is_named or not 0 < period < len(self.edges_s):
            return STILL_AIR
        number = period - 1
        return Air(
            float(self.time_factor[number, column]), float(self.energy_factor[number, column])
        )

    def air_between(self, from_id: str, to_id: str, *, at_s: float) -> Air:
        """The air of the segment between these stations for a flight that begins at this moment."""
        return self.air(
            int(segment_rows(self.network, [(from_id, to_id)])[0]), self.period_at(at_s)
        )

    def closes(self, from_id: str, to_id: str, *, start_s: float, end_s: float) -> bool:
        """Whether the segment is closed at some moment from `start_s` to `end_s`."""
        segment = int(segment_rows(self.network, [(from_id, to_id)])[0])
        met = range(self.period_at(start_s), self.period_at(end_s) + 1)
        return any(self.air(segment, period).time_factor == math.inf for period in met)

    def has_air(
        self, segment: int, air: Air, *, start_s: float, end_s: float, within_s: float
    ) -> bool:
        """Whether a flight between these moments meets this air and no closed period.

        A period counts from `within_s` seconds earlier until as much later.
        """
        begun = {self.period_at(start_s - within_s), self.period_at(start_s + within_s)}
        if all(self.air(segment, period) != air for period in begun):
            return False
        met = range(self.period_at(start_s + within_s), self.period_at(end_s - within_s) + 1)
        return all(self.air(segment, period).time_factor < math.inf for period in met)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Weather):
            return NotImplemented
        return self.network == other.network and all(
            np.array_equal(getattr(self, name), getattr(other, name))
            for name in ("segment", "edges_s", "time_factor", "energy_factor")
        )

    __hash__ = None  # type: ignore[assignment]

    @classmethod
    def __get_pydantic_core_schema__(
        cls, _source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        """Read and written as a `WeatherDocument`, for the network of the same model."""
        return core_schema.with_info_wrap_validator_function(
            _read,
            handler.generate_schema(WeatherDocument),
            serialization=core_schema.plain_serializer_function_ser_schema(
                lambda weather: weather.document().model_dump(mode="json")
            ),
        )


def _read(value: Any, handler: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Weather:
    """The weather in a problem's `weather`, any JSON value or a `Weather`."""
    network = info.data.get("network", Network({}, ()))
    if isinstance(value, Weather):
        if value.network is not network and value.network != network:
            fault = FieldFault("weather", "is the weather of another network")
            return replace(value, faults=(fault,))
        return value
    refuse_too_many_factors(value)
    return Weather.of(network, handler(value))


def segment_rows(network: Network, segments: Sequence[Sequence[str]]) -> Longs:
    """The row of each segment, -1 where the network has none."""
    outgoing, row_of = network.outgoing, network.row_of
    ends = np.array(
        [row_of.get(name, -1) for name in chain.from_iterable(segments)],  # type: ignore[call-overload]
        np.int64,
    )
    from_row, to_row = ends[::2], ends[1::2]
    found = np.full(len(segments), -1, np.int64)
    if not len(row_of):
        return found
    place, end = outgoing.offsets[from_row], outgoing.offsets[from_row + 1]
    left = np.flatnonzero((from_row >= 0) & (to_row >= 0))
    while len(left):
        left = left[place[left] < end[left]]
        is_it = outgoing.station[place[left]] == to_row[left]
        found[left[is_it]] = outgoing.segment[place[left[is_it]]]
        left = left[~is_it]
        place[left] += 1
    return found
