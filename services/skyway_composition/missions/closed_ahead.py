"""What is closed, asked the way a flight under way asks: this landing then, this segment then."""

from collections import defaultdict
from collections.abc import Iterable

from skyway.contracts.flight_step import FlyStep
from skyway.ids import StationId
from skyway.network.network import Network
from skyway.planner.problem_parts import SegmentClosure, StationClosure

_Span = tuple[float, float]


class ClosedAhead:
    """Closures of a network, whose seconds count from `start_ms`."""

    def __init__(
        self,
        network: Network,
        closures: Iterable[StationClosure | SegmentClosure],
        *,
        start_ms: int,
    ) -> None:
        self._network = network
        self._start_ms = start_ms
        self._stations: dict[StationId, list[_Span]] = defaultdict(list)
        self._segments: dict[tuple[StationId, StationId], list[_Span]] = defaultdict(list)
        for closure in closures:
            span = closure.start_s, float("inf") if closure.end_s is None else closure.end_s
            if isinstance(closure, StationClosure):
                self._stations[closure.station_id].append(span)
            else:
                self._segments[closure.from_id, closure.to_id].append(span)

    def closes_landing(self, station_id: StationId, at_ms: int) -> bool:
        """Whether nobody may land there at that moment, or the station is no longer there."""
        if station_id not in self._network.stations:
            return True
        at_s = (at_ms - self._start_ms) / 1000
        return any(start_s <= at_s < end_s for start_s, end_s in self._stations[station_id])

    def closes_flight(self, step: FlyStep, start_ms: int, end_ms: int) -> bool:
        """Whether a segment may not be flown at some moment of that time, or is gone."""
        return self.closes_segment(step.from_id, step.to_id, start_ms, end_ms)

    def closes_segment(
        self, from_id: StationId, to_id: StationId, start_ms: int, end_ms: int
    ) -> bool:
        """The same for a segment by its ends."""
        known = self._network.stations
        if from_id not in known or not any(
            each.to_id == to_id for each in self._network.segments_from(from_id)
        ):
            return True
        begin_s, until_s = (start_ms - self._start_ms) / 1000, (end_ms - self._start_ms) / 1000
        spans = self._segments[from_id, to_id]
        return any(start_s < until_s and begin_s < end_s for start_s, end_s in spans)

    def is_closed_for_good(self, station_id: StationId) -> bool:
        """Whether nobody knows when a station opens again."""
        spans = self._stations[station_id]
        return station_id not in self._network.stations or any(
            end_s == float("inf") for _, end_s in spans
        )
