"""A pad that is out of order now, as those see it who count free pads."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from skyway.ids import StationId
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
