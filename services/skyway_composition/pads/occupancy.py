"""How taken the pads of a station are at a moment."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from skyway.ids import StationId
from skyway.planner.pad_book import OPEN_MS
from skyway_composition.closures.closure import Closure


@dataclass(frozen=True, slots=True)
class Outage:
    """Until when a pad is out of order; None where nobody knows."""

    until_ms: int | None


def outages_by_pad(closures: Iterable[Closure]) -> dict[StationId, dict[int, Outage]]:
    """The outages by station and pad; of several on one pad the one that lasts longest."""
    by_station: dict[StationId, dict[int, Outage]] = defaultdict(dict)
    for each in closures:
        if each.station_id is None or each.pad is None:
            continue
        known = by_station[each.station_id].get(each.pad)
        if known is None or _lasts_longer(each, known):
            by_station[each.station_id][each.pad] = Outage(each.until_ms)
    return by_station


def _lasts_longer(closure: Closure, known: Outage) -> bool:
    if known.until_ms is None:
        return False
    return closure.until_ms is None or closure.until_ms > known.until_ms


@dataclass(frozen=True, slots=True)
class Occupancy:
    """A station's pads, those that are taken, reservations to come, and when the next is free.

    None while none is taken, and where nobody knows.
    """

    pads: int
    pads_taken: int = 0
    queue: int = 0
    next_free_ms: int | None = None

    @property
    def is_none(self) -> bool:
        """Whether nobody has a pad, or will."""
        return not (self.pads_taken or self.queue)

    def with_outages(
        self, held: Iterable[tuple[int, int]], broken: Mapping[int, Outage]
    ) -> "Occupancy":
        """The use when these pads are out of order as well: each is free when it works again.

        `held` are the pads that are taken, each with the end of its reservation.
        """
        taken = dict(held)
        for pad, outage in broken.items():
            if outage.until_ms is None:
                taken[pad] = OPEN_MS
            else:
                taken[pad] = max(taken.get(pad, 0), outage.until_ms)
        next_free_ms = min(taken.values(), default=OPEN_MS)
        return replace(
            self,
            pads_taken=sum(pad < self.pads for pad in taken),
            next_free_ms=None if next_free_ms == OPEN_MS else next_free_ms,
        )
