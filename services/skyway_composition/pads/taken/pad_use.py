"""How taken the pads of a station are at a moment."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from skyway.planner.pad_book import OPEN_MS
from skyway_composition.pads.taken.outage import Outage


@dataclass(frozen=True, slots=True)
class PadUse:
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
    ) -> "PadUse":
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
