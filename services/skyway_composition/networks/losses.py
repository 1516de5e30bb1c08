"""What a new version of a network takes away from those who fly by the old one."""

from collections.abc import Iterable, Iterator

from skyway.ids import ClosureId, NetworkId, StationId
from skyway.network.network import Network, Zone
from skyway.planner.airspace import Airspace, SegmentEnds
from skyway.units import moment_to_ms
from skyway_composition.closures.closure import Closure, ClosureKind
from skyway_composition.closures.impact import Reach
from skyway_composition.networks.prepared import PreparedNetwork

#: Stations and segments that are named in words, so that a sentence stays one.
_MOST_NAMED = 5


def losses(old: PreparedNetwork, new: Network, *, now_ms: int) -> tuple[Reach, ...]:
    """The stations and segments that are gone and the zones that are new, as closures reach them.

    Pads that drones have reserved cannot be taken away (`publish`).
    """
    late_ms = round(old.settings.tolerated_lateness_s * 1000)
    return tuple(_losses(old.network_id, old.network, new, now_ms=now_ms, late_ms=late_ms))


def _losses(
    network_id: NetworkId, old: Network, new: Network, *, now_ms: int, late_ms: int
) -> Iterator[Reach]:
    stations = frozenset(old.row_of.keys() - new.row_of.keys())
    if stations:
        yield Reach(
            _closure("STATION", network_id, now_ms),
            stations=stations,
            late_ms=late_ms,
            what=f"no longer in the network: {_named(stations)}",
        )
    segments = _ends(old) - _ends(new)
    if segments:
        ways = (f"{from_id} to {to_id}" for from_id, to_id in segments)
        yield Reach(
            _closure("SEGMENT", network_id, now_ms),
            segments=segments,
            late_ms=late_ms,
            what=f"no longer in the network: {_named(ways)}",
        )
    known = {zone.zone_id: zone for zone in old.zones}
    added = [zone for zone in new.zones if known.get(zone.zone_id) != zone]
    for reach in Airspace.over(new, added).reaches:
        yield Reach(
            _closure("ZONE", network_id, now_ms, zone=reach.zone),
            stations=frozenset(reach.stations),
            segments=frozenset(reach.segments),
            late_ms=late_ms,
            what=f"zone {reach.zone.zone_id!r} is closed to flight",
        )


def _closure(
    kind: ClosureKind, network_id: NetworkId, now_ms: int, *, zone: Zone | None = None
) -> Closure:
    """What stands for a loss; it is nowhere kept, since the version itself says so."""
    starts_at = None if zone is None else zone.active_from
    ends_at = None if zone is None else zone.active_until
    return Closure(
        closure_id=ClosureId("version"),
        kind=kind,
        network_id=network_id,
        from_ms=now_ms if starts_at is None else moment_to_ms(starts_at),
        made_ms=now_ms,
        until_ms=None if ends_at is None else moment_to_ms(ends_at),
    )


def _ends(network: Network) -> frozenset[SegmentEnds]:
    columns = network.columns
    ids: tuple[StationId, ...] = tuple(columns.station_ids)
    rows = zip(columns.from_row.tolist(), columns.to_row.tolist(), strict=True)
    return frozenset((ids[from_row], ids[to_row]) for from_row, to_row in rows)


def _named(names: Iterable[str]) -> str:
    known = sorted(names)
    more = len(known) - _MOST_NAMED
    return ", ".join(known[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
