"""The stations of networks: announced ones, cached in this process, and questions about others.

Composition announces each new version of a network on MQTT. A process that listens can then answer
questions about stations without asking composition. The cache lacks the stations of networks that
are too large to be sent or cached. It may still hold a version that was replaced a moment ago. When
an error would matter, ask composition: `check_stations` asks all its servers.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from skyway.cells import CellClients, ask_all
from skyway.contracts.station_check import NetworkStations, StationCheck, StationCheckQuery
from skyway.contracts.topics import NETWORK_VERSION
from skyway.contracts.world import NetworkVersion
from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.loops import Wake, repeat
from skyway.runtime.mqtt.client import MqttClient, Received

#: Most stations in the cache, of all networks together; a station takes 100 to 200 bytes.
_MOST_CACHED: Final = 200_000

#: Seconds of wall time until composition is asked again after it answered an older version.
_ASK_EVERY_S: Final = 5.0

#: The longest wait for a server that looks up stations, wall seconds. A fleet has thousands.
_CHECKED_WITHIN_S: Final = 10.0

#: Answers all stations of a network's current version; no station when there are too many.
AllStations = Callable[[NetworkId], Awaitable[NetworkStations]]


class KnownStation(NamedTuple):
    """A station of a cached network; a way leads to all stations with the same `area`."""

    station_id: StationId
    area: tuple[NetworkId, int]
    position: Position
    name: str | None


@dataclass(frozen=True, slots=True)
class _CachedVersion:
    """The stations of one version, each with its position and its part of the network."""

    version: int
    places: Mapping[StationId, tuple[Position, int]]
    loading_s: float = 0.0
    dropoff_s: float = 0.0
    proof_s: float = 0.0
    names: Mapping[StationId, str] = field(default_factory=dict)


class CachedNetworks:
    """One version of each network by its stations; a station belongs to one network.

    `revision` grows with each change: results that were computed from the cache are then outdated.
    Versions that have left the cache are kept for questions that accept outdated ones.
    """

    def __init__(self) -> None:
        self._networks: dict[NetworkId, _CachedVersion] = {}
        self._outdated: dict[NetworkId, _CachedVersion] = {}
        self.revision = 0

    def position_if_connected(
        self, start: StationId, *, to: Iterable[StationId]
    ) -> Position | None:
        """The position of a station from which ways lead to all these stations.

        None when the cache does not show such ways; there may still be some.
        """
        return _position_if_connected(self._networks.values(), start, to)

    def last_position_if_connected(
        self, start: StationId, *, to: Iterable[StationId]
    ) -> Position | None:
        """The same, also from versions that may have been replaced: for use without composition."""
        last = {**self._outdated, **self._networks}
        return _position_if_connected(last.values(), start, to)

    def network_of(self, station_id: StationId) -> NetworkId | None:
        """The network of a station; None when the station is not cached."""
        for network_id, network in self._networks.items():
            if station_id in network.places:
                return network_id
        return None

    def last_network_of(self, station_id: StationId) -> NetworkId | None:
        """The network of a station, also by versions of networks that have been replaced."""
        for network_id, network in {**self._outdated, **self._networks}.items():
            if station_id in network.places:
                return network_id
        return None

    def station_ids(self) -> Iterator[StationId]:
        """The stations of all networks, outdated ones too."""
        for network in {**self._outdated, **self._networks}.values():
            yield from network.places

    def stations(self) -> Iterator[KnownStation]:
        """The stations of all networks, outdated ones too."""
        for network_id, network in {**self._outdated, **self._networks}.items():
            for station_id, (position, part) in network.places.items():
                name = network.names.get(station_id)
                yield KnownStation(station_id, (network_id, part), position, name)

    def service_times_s(
        self, station_id: StationId, *, needs_proof: bool = False
    ) -> tuple[float, float]:
        """How long loading and a hand-over take in a station's network; 0 if it is not cached."""
        for network in self._networks.values():
            if station_id in network.places:
                proof_s = network.proof_s if needs_proof else 0.0
                return network.loading_s, network.dropoff_s + proof_s
        return 0.0, 0.0

    def version_of(self, network_id: NetworkId) -> int | None:
        """The cached version of a network; None when there is none."""
        cached = self._networks.get(network_id)
        return None if cached is None else cached.version

    def put(self, stations: NetworkStations) -> None:
        """Cache this version of a network, without its stations when the cache would be too big."""
        self.drop(stations.network_id)
        self._outdated.pop(stations.network_id, None)
        cached = sum(len(network.places) for network in self._networks.values())
        has_room = cached + len(stations.station_ids) <= _MOST_CACHED
        self._networks[stations.network_id] = (
            _cached_version(stations) if has_room else _CachedVersion(stations.version, {})
        )
        self.revision += 1

    def put_outdated(self, stations: NetworkStations) -> None:
        """Keep a version that may have been replaced, for questions that accept one."""
        self._outdated[stations.network_id] = _cached_version(stations)
        self.revision += 1

    def drop(self, network_id: NetworkId) -> None:
        """Remove a network from the cache."""
        if (dropped := self._networks.pop(network_id, None)) is not None:
            self._outdated[network_id] = dropped
        self.revision += 1

    def clear(self) -> None:
        """Remove all networks from the cache."""
        self._outdated |= self._networks
        self._networks.clear()
        self.revision += 1


def _cached_version(stations: NetworkStations) -> _CachedVersion:
    each = zip(stations.positions, stations.parts, strict=True)
    places = dict(zip(stations.station_ids, each, strict=True))
    times_s = stations.loading_s, stations.dropoff_s, stations.proof_s
    return _CachedVersion(stations.version, places, *times_s, names=stations.names)


def _position_if_connected(
    networks: Iterable[_CachedVersion], start: StationId, to: Iterable[StationId]
) -> Position | None:
    for network in networks:
        if (place := network.places.get(start)) is not None:
            position, part = place
            ends = (network.places.get(each) for each in to)
            return position if all(end and end[1] == part for end in ends) else None
    return None


def stations_from(server_of: Callable[[NetworkId], ServiceClient]) -> AllStations:
    """`AllStations` that asks the server of composition that serves the network."""

    async def ask(network_id: NetworkId) -> NetworkStations:
        path = f"/internal/networks/{network_id}/stations"
        return await server_of(network_id).call("GET", path, answer=NetworkStations)

    return ask


#: Stores the stations of a version that was learned.
Keep = Callable[[NetworkStations], Awaitable[None]]


async def _keep_nothing(_stations: NetworkStations) -> None:
    """For a process that does not need the stations after a restart."""


class NetworkLearner:
    """Fills `cached` with announced networks, and clears it when announcements may be missed.

    `keep` gets each version that was learned, for the next start.
    """

    def __init__(self, all_stations: AllStations, *, keep: Keep = _keep_nothing) -> None:
        self.cached = CachedNetworks()
        self._all_stations = all_stations
        self._keep = keep
        self._announced: dict[NetworkId, int] = {}
        self._wake = Wake()

    async def run(self, mqtt: MqttClient) -> None:
        """Cache each version that is announced; clear the cache when the connection is lost."""
        announced = mqtt.batches(NETWORK_VERSION)
        async with asyncio.TaskGroup() as group:
            group.create_task(self._receive(announced))
            group.create_task(self._clear_when_disconnected(mqtt))
            learn = repeat("networks", self.learn, every_s=_ASK_EVERY_S, wake=self._wake)
            group.create_task(learn)

    def note(self, message: NetworkVersion) -> None:
        """Note an announced version; an older version leaves the cache immediately."""
        network_id, version = message.network_id, message.version
        self._announced[network_id] = version
        cached = self.cached.version_of(network_id)
        if cached is not None and cached < version:
            self.cached.drop(network_id)
        self._wake.set()

    async def learn(self) -> bool:
        """Step of a loop: ask for the stations of announced networks that are not cached.

        Raises
        ------
        ServiceUnavailable
            Composition or the database does not answer now.
        """
        silent: ServiceUnavailable | None = None
        for network_id in [each for each in self._announced if self._is_new(each)]:
            try:
                stations = await self._all_stations(network_id)
            except ServiceUnavailable as error:
                silent = error  # another network may have another server
                continue
            # A newer announcement, or a lost connection, may have come in the meantime. The next
            # step asks again then.
            if stations.version >= self._announced.get(network_id, stations.version + 1):
                self.cached.put(stations)
                await self._keep(stations)
        if silent is not None:
            raise silent
        return False

    def forget(self) -> None:
        """Clear the cache until networks are announced again."""
        self._announced.clear()
        self.cached.clear()

    def _is_new(self, network_id: NetworkId) -> bool:
        return self.cached.version_of(network_id) is None

    async def _receive(self, announced: AsyncIterator[list[Received[NetworkVersion]]]) -> None:
        async for batch in announced:
            for received in batch:
                self.note(received.message)

    async def _clear_when_disconnected(self, mqtt: MqttClient) -> None:
        while True:
            await mqtt.wait_connected()
            await mqtt.wait_lost()
            self.forget()


async def check_stations(servers: CellClients, query: StationCheckQuery) -> StationCheck:
    """What all servers together know about these stations.

    Raises
    ------
    RemoteProblem
        NO_NETWORK: no network is published at any server.
    ServiceUnavailable
        A server does not answer, and may have a station that no other server has.
    """

    async def ask(client: ServiceClient) -> StationCheck | RemoteProblem:
        try:
            return await client.call(
                "POST", "/internal/station-checks", body=query, answer=StationCheck
            )
        except RemoteProblem as problem:
            if problem.problem.get("code") != "NO_NETWORK":
                raise
            return problem

    answers = await ask_all(servers.every(), ask, within_s=_CHECKED_WITHIN_S)
    checks = [each for each in answers.given.values() if isinstance(each, StationCheck)]
    found = _together(query, checks)
    if found.unknown:
        answers.must_be_whole()
    for problem in answers.given.values():
        if not checks and isinstance(problem, RemoteProblem):
            raise problem
    return found


def _together(query: StationCheckQuery, checks: list[StationCheck]) -> StationCheck:
    """One answer from all answers; a server knows only the stations of its own networks."""
    asked = dict.fromkeys(query.station_ids)
    network_ids = {name: each for check in checks for name, each in check.network_ids.items()}
    reached = {
        station_id
        for check in checks
        for station_id in check.network_ids
        if station_id not in check.unreachable
    }
    return StationCheck(
        network_ids=network_ids,
        positions={name: each for check in checks for name, each in check.positions.items()},
        unknown=tuple(each for each in asked if each not in network_ids),
        unreachable=tuple(each for each in asked if each in network_ids and each not in reached),
        closed=tuple(each for check in checks for each in check.closed),
        isolated=tuple(each for check in checks for each in check.isolated),
        networks={name: each for check in checks for name, each in check.networks.items()},
    )
