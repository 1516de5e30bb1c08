"""Publish a network: its version changes exactly when its content changes.

Missions that use a station, segment, connector or airspace that is taken away are replanned.
`NetworkVersions` publishes the current versions over MQTT: retained, on change and on connect.
"""

import asyncio
import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from skyway.contracts.network_document import settings_of
from skyway.contracts.topics import NETWORK_VERSION
from skyway.contracts.world import NetworkVersion
from skyway.ids import ClosureId, ConnectorId, NetworkId, StationId
from skyway.network.geojson import read_network, write_network
from skyway.network.network import Network, Zone
from skyway.planner.airspace import Airspace, SegmentEnds
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict, NotFound, PreconditionFailed
from skyway.runtime.minting import Mint
from skyway.runtime.mqtt.client import MqttClient
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms
from skyway_composition.closures.closure import Closure, ClosureKind, Impact, Reach
from skyway_composition.networks import store
from skyway_composition.networks.prepared import PreparedNetwork, PreparedNetworks
from skyway_composition.networks.station_store import (
    replace_stations,
    reserved_pads,
    stations_elsewhere,
)
from skyway_composition.networks.store import VersionRow, all_current
from skyway_composition.own_cells import OwnCells

#: The most stations or segments that a sentence names.
_MOST_NAMED = 5


@dataclass(frozen=True, slots=True)
class Content:
    """A network and its GeoJSON in the form that is stored, hashed and served."""

    network: Network
    geojson: bytes
    sha256: str


@dataclass(frozen=True, slots=True)
class Published:
    """The version that a PUT published; `is_new` when it is the network's first version."""

    row: VersionRow
    is_new: bool


def etag(row: VersionRow) -> str:
    """The entity tag of a version."""
    return f'"{row.version}-{row.sha256}"'


async def read_content(document: Mapping[str, Any]) -> Content:
    """The network in a GeoJSON document of any JSON values, checked with its settings.

    Raises
    ------
    InvalidNetwork
        Names the field at fault.
    """
    return await asyncio.to_thread(_read_content, document)


async def publish(
    db: Database,
    network_id: NetworkId,
    *,
    content: Content,
    if_match: str | None,
    now_ms: int,
    networks: PreparedNetworks,
    impact: Impact,
) -> Published:
    """Make this content the network's current version; the same content changes nothing.

    Missions that use what the new version takes away are replanned, as after a closure.

    Raises
    ------
    PreconditionFailed
        `if_match` is not the current version's entity tag.
    Conflict
        A station belongs to another network, or the new version would remove a reserved pad.
    """
    done: Published | None = None
    while done is None:
        replaced = await _replaced(networks, network_id)
        lost: tuple[Reach, ...] = ()
        if replaced is not None:
            lost = await asyncio.to_thread(losses, replaced, content.network, now_ms=now_ms)
        async with db.write() as tx:
            current = await store.lock_version(tx, network_id)
            _check_precondition(current, if_match)
            if current is not None and current.sha256 == content.sha256:
                return Published(current, is_new=False)
            if (current and current.version) != (replaced and replaced.version):
                continue  # another process has published a version in between
            done = await _put(tx, network_id, current, content=content, now_ms=now_ms)
            for reach in lost:
                await impact.apply(tx, reach)
    return done


async def _replaced(networks: PreparedNetworks, network_id: NetworkId) -> PreparedNetwork | None:
    try:
        return await networks.current(network_id)
    except NotFound:
        return None


async def _put(
    tx: Tx, network_id: NetworkId, current: VersionRow | None, *, content: Content, now_ms: int
) -> Published:
    await _refuse_foreign_stations(tx, network_id, content.network)
    await _refuse_dropped_reservations(tx, network_id, content.network)
    version = 1 if current is None else current.version + 1
    row = VersionRow(network_id, version, content.sha256, now_ms)
    await store.add_version(tx, row, content=content.geojson)
    await replace_stations(tx, network_id, content.network.stations.values())
    return Published(row, is_new=current is None)


def _read_content(document: Mapping[str, Any]) -> Content:
    network = read_network(document)
    settings_of(network)
    text = json.dumps(write_network(network), ensure_ascii=False, separators=(",", ":"))
    geojson = text.encode()
    return Content(network, geojson, hashlib.sha256(geojson).hexdigest())


def _check_precondition(current: VersionRow | None, if_match: str | None) -> None:
    if if_match is None:
        return
    present = "none" if current is None else etag(current)
    expected = [tag.strip() for tag in if_match.split(",")]
    if current is None or (present not in expected and "*" not in expected):
        raise PreconditionFailed(expected=if_match, present=present)


async def _refuse_foreign_stations(tx: Tx, network_id: NetworkId, network: Network) -> None:
    elsewhere = await stations_elsewhere(tx, network_id, list(network.stations))
    if elsewhere:
        named = ", ".join(f"{row.station_id!r} of {row.network_id!r}" for row in elsewhere)
        raise Conflict(
            "STATION_ELSEWHERE", f"these stations already belong to another network: {named}"
        )


async def _refuse_dropped_reservations(tx: Tx, network_id: NetworkId, network: Network) -> None:
    needed = await reserved_pads(tx, network_id)
    dropped = sorted(
        station_id
        for station_id, pads in needed.items()
        if station_id not in network.stations or network.stations[station_id].pads < pads
    )
    if dropped:
        raise Conflict(
            "STATION_RESERVED",
            "drones have reserved pads that this version removes; close these stations or pads "
            "first: " + ", ".join(dropped),
        )


def losses(old: PreparedNetwork, new: Network, *, now_ms: int) -> tuple[Reach, ...]:
    """What the new version takes away, each in the form of a closure's reach.

    Removed stations, segments and connectors of pads, and added zones; not reserved pads, because
    `publish` refuses to remove one.
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
    unfit = _with_fewer_connectors(old, new)
    if unfit:
        yield Reach(
            _closure("PAD", network_id, now_ms),
            what=f"the pads have other connectors now: {_named(unfit)}",
            pads_now_with=unfit,
        )
    previous = {zone.zone_id: zone for zone in old.zones}
    added = [zone for zone in new.zones if previous.get(zone.zone_id) != zone]
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
    """A closure that stands for a loss; it is not stored, because the version says the same."""
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


def _with_fewer_connectors(
    old: Network, new: Network
) -> Mapping[StationId, frozenset[ConnectorId]]:
    """The stations whose pads fit fewer drones than before, with the connectors they have now."""
    before = old.pad_connectors.of_station
    return {
        station_id: connectors
        for station_id, connectors in new.pad_connectors.of_station.items()
        if station_id in old.row_of
        and (station_id not in before or not before[station_id] <= connectors)
    }


def _ends(network: Network) -> frozenset[SegmentEnds]:
    columns = network.columns
    ids: tuple[StationId, ...] = tuple(columns.station_ids)
    rows = zip(columns.from_row.tolist(), columns.to_row.tolist(), strict=True)
    return frozenset((ids[from_row], ids[to_row]) for from_row, to_row in rows)


def _named(names: Iterable[str]) -> str:
    ordered = sorted(names)
    more = len(ordered) - _MOST_NAMED
    return ", ".join(ordered[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")


@dataclass(slots=True)
class NetworkVersions:
    """Publishes the current versions of own networks that it has not published yet."""

    db: Database
    mqtt: MqttClient
    clock: FleetClock
    mint: Mint
    own: OwnCells
    _published: dict[NetworkId, int] = field(default_factory=dict)

    def forget(self) -> None:
        """Publish everything again, because a broker may lose retained messages in a restart."""
        self._published.clear()

    async def step(self) -> bool:
        """Publish the versions that are new."""
        if not self.mqtt.is_connected:
            return False
        async with self.db.read() as connection:
            rows = await all_current(connection)
        for row in rows:
            is_own = row.network_id not in self.own.foreign
            if is_own and self._published.get(row.network_id) != row.version:
                message = NetworkVersion(
                    message_id=self.mint("msg"),
                    sent_at=self.clock.now(),
                    network_id=row.network_id,
                    version=row.version,
                    sha256=row.sha256,
                    href=f"/v1/networks/{row.network_id}?version={row.version}",
                )
                await self.mqtt.publish(NETWORK_VERSION(row.network_id), message)
                self._published[row.network_id] = row.version
        return False
