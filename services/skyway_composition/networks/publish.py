"""Publishing a network: its version changes exactly when its content does."""

import asyncio
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from skyway.ids import NetworkId
from skyway.network.geojson import read_network, write_network
from skyway.network.network import Network
from skyway.runtime.errors import Conflict, NotFound, PreconditionFailed
from skyway.runtime.sql.database import Database, Tx
from skyway_composition.closures.impact import Impact, Reach
from skyway_composition.networks import store
from skyway_composition.networks.losses import losses
from skyway_composition.networks.prepared import PreparedNetwork, PreparedNetworks
from skyway_composition.networks.settings import settings_of
from skyway_composition.networks.stations.store import (
    replace_stations,
    reserved_pads,
    stations_elsewhere,
)
from skyway_composition.networks.store import VersionRow


@dataclass(frozen=True, slots=True)
class Content:
    """A network and its GeoJSON in the one form that is stored, hashed and served."""

    network: Network
    geojson: bytes
    sha256: str


@dataclass(frozen=True, slots=True)
class Published:
    """What a PUT led to; `is_new` when the network was not known before."""

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
    """Make this the network's current version, unless it is already.

    Missions that fly by what it takes away look for other plans from then on, as when it is closed.

    Raises
    ------
    PreconditionFailed
        `if_match` is not the current version's entity tag.
    Conflict
        A station belongs to another network, or a pad that is reserved would go.
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
                continue  # somebody else has published meanwhile
            done = await _put(tx, network_id, current, content=content, now_ms=now_ms)
            for reach in lost:
                await impact.strike(tx, reach)
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
        raise Conflict("STATION_ELSEWHERE", f"station ids belong to one network; taken: {named}")


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
            "drones have reserved pads that would go, close these stations or pads first: "
            + ", ".join(dropped),
        )
