"""How many pads of a station are occupied at a moment: reserved, or out of order."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from skyway.ids import StationId
from skyway.planner.pad_book import OPEN_MS
from skyway_composition.closures.closure import Closure


@dataclass(frozen=True, slots=True)
class Outage:
    """Until when a pad is out of order; None when the end is not known."""

    until_ms: int | None


def outages_by_pad(closures: Iterable[Closure]) -> dict[StationId, dict[int, Outage]]:
    """The outages by station and pad; of several outages of one pad the longest."""
    by_station: dict[StationId, dict[int, Outage]] = defaultdict(dict)
    for each in closures:
        if each.station_id is None or each.pad is None:
            continue
        longest = by_station[each.station_id].get(each.pad)
        if longest is None or _lasts_longer(each, longest):
            by_station[each.station_id][each.pad] = Outage(each.until_ms)
    return by_station


def _lasts_longer(closure: Closure, other: Outage) -> bool:
    if other.until_ms is None:
        return False
    return closure.until_ms is None or closure.until_ms > other.until_ms


@dataclass(frozen=True, slots=True)
class PadOccupancy:
    """Why a pad is occupied: until when it is reserved, its outage, or both."""

    held_until_ms: int | None
    outage: Outage | None


def uses_by_pad(
    held: Iterable[tuple[StationId, int, int]], broken: Mapping[StationId, Mapping[int, Outage]]
) -> dict[StationId, dict[int, PadOccupancy]]:
    """The occupied pads of stations in order of their numbers, each once.

    `held` are the pads that are reserved now, each with the end of its reservation.
    """
    ends = {(station_id, pad): end_ms for station_id, pad, end_ms in held}
    out = {(at, pad): outage for at, pads in broken.items() for pad, outage in pads.items()}
    uses: dict[StationId, dict[int, PadOccupancy]] = defaultdict(dict)
    for station_id, pad in sorted(ends.keys() | out.keys()):
        use = PadOccupancy(ends.get((station_id, pad)), out.get((station_id, pad)))
        uses[station_id][pad] = use
    return uses


@dataclass(frozen=True, slots=True)
class Occupancy:
    """A station's pads, how many are occupied, and how many reservations begin later (`queue`).

    A pad that is reserved and out of order is counted once, however many outages it has.
    `next_free_ms` is when the next occupied pad becomes free; None when no pad is occupied, or
    when the end of an outage is not known.
    """

    pads: int
    pads_taken: int = 0
    queue: int = 0
    next_free_ms: int | None = None

    @property
    def is_none(self) -> bool:
        """Whether no pad is occupied or reserved for later."""
        return not (self.pads_taken or self.queue)

    def with_outages(
        self, held: Iterable[tuple[int, int]], broken: Mapping[int, Outage]
    ) -> "Occupancy":
        """The occupancy with these pads out of order too; each is free when its outage ends.

        `held` are the reserved pads, each with the end of its reservation.
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
