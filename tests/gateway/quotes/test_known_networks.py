"""Stations that are known without asking composition."""

import asyncio
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import pytest
from skyway_gateway.quotes.known_networks import KnownNetworks

from skyway.contracts.station_check import NetworkStations
from skyway.contracts.topic import Topic
from skyway.contracts.world import NetworkVersion
from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.runtime.mqtt.inbox import Received


@dataclass
class Told:
    """Composition, of which only the stations of networks are asked."""

    networks: dict[str, NetworkStations] = field(default_factory=dict)
    asked: list[str] = field(default_factory=list)

    async def all_stations(self, network_id: str) -> NetworkStations:
        self.asked.append(network_id)
        return self.networks[network_id]


def make_network(network_id: str = "city", *, version: int = 1, **parts: int) -> NetworkStations:
    return NetworkStations(
        network_id=NetworkId(network_id),
        version=version,
        station_ids=tuple(StationId(each) for each in parts),
        positions=tuple(Position(0.0, float(number)) for number in range(len(parts))),
        parts=tuple(parts.values()),
    )


def announced(network_id: str = "city", *, version: int = 1) -> NetworkVersion:
    return NetworkVersion(
        message_id="msg_1",
        sent_at=datetime(2026, 3, 1, tzinfo=UTC),
        network_id=NetworkId(network_id),
        version=version,
        sha256="0" * 64,
        href="/",
    )


def start_of_ways(known: KnownNetworks, start: str, *ends: str) -> Position | None:
    return known.start_of_ways(StationId(start), to=[StationId(end) for end in ends])


@pytest.fixture
def composition() -> Told:
    return Told({"city": make_network(a=0, b=0, island=2)})


@pytest.fixture
def known(composition: Any) -> KnownNetworks:
    return KnownNetworks(composition)


async def test_ways_within_a_part_of_an_announced_network_are_known(known: KnownNetworks) -> None:
    known.announce(announced())
    await known.learn()

    assert start_of_ways(known, "b", "a", "b") == Position(0.0, 1.0)


@pytest.mark.parametrize(("start", "end"), [("a", "island"), ("a", "new"), ("new", "a")])
async def test_other_stations_and_ways_are_to_be_asked_about(
    known: KnownNetworks, start: str, end: str
) -> None:
    known.announce(announced())
    await known.learn()

    assert start_of_ways(known, start, end) is None


async def test_a_known_version_is_asked_for_once(known: KnownNetworks, composition: Told) -> None:
    known.announce(announced())
    await known.learn()
    known.announce(announced())
    await known.learn()

    assert composition.asked == ["city"]


async def test_nothing_counts_of_a_version_that_was_replaced(
    known: KnownNetworks, composition: Told
) -> None:
    known.announce(announced())
    await known.learn()
    composition.networks["city"] = make_network(version=2, b=0, c=0)

    known.announce(announced(version=2))
    at_once = start_of_ways(known, "a", "b")
    await known.learn()

    assert at_once is None
    assert start_of_ways(known, "a", "b") is None
    assert start_of_ways(known, "c", "b") == Position(0.0, 1.0)


async def test_what_is_older_than_announced_is_not_kept(known: KnownNetworks) -> None:
    known.announce(announced(version=2))
    await known.learn()

    assert start_of_ways(known, "a", "b") is None


async def test_nothing_is_known_while_nothing_could_be_heard(known: KnownNetworks) -> None:
    known.announce(announced())
    await known.learn()

    known.forget()

    assert start_of_ways(known, "a", "b") is None


async def test_stations_beyond_what_may_be_kept_are_asked_about(
    known: KnownNetworks, composition: Told
) -> None:
    ids = tuple(StationId(f"s{number}") for number in range(200_001))
    composition.networks["city"] = NetworkStations(
        network_id=NetworkId("city"),
        version=1,
        station_ids=ids,
        positions=(Position(0.0, 0.0),) * len(ids),
        parts=(0,) * len(ids),
    )
    known.announce(announced())
    await known.learn()
    await known.learn()

    assert start_of_ways(known, "s0", "s1") is None
    assert composition.asked == ["city"]


class Line:
    """An MQTT client as far as it is heard: what arrives, and whether it is connected."""

    def __init__(self) -> None:
        self.arrived: asyncio.Queue[NetworkVersion] = asyncio.Queue()
        self.connected, self.lost = asyncio.Event(), asyncio.Event()

    async def batches(self, topic: Topic[NetworkVersion]) -> AsyncIterator[list[Any]]:
        while True:
            message = await self.arrived.get()
            yield [Received(topic, (message.network_id,), message, retained=True)]

    async def wait_connected(self) -> None:
        await self.connected.wait()

    async def wait_lost(self) -> None:
        await self.lost.wait()
        self.connected.clear()


async def until(holds: Callable[[], bool]) -> None:
    async with asyncio.timeout(5):
        while not holds():  # noqa: ASYNC110 - what is waited for tells nobody
            await asyncio.sleep(0)


async def test_what_is_heard_is_learned_and_forgotten_with_the_connection(
    known: KnownNetworks,
) -> None:
    line: Any = Line()
    line.connected.set()
    running = asyncio.create_task(known.run(line))

    line.arrived.put_nowait(announced())
    await until(lambda: start_of_ways(known, "a", "b") is not None)
    line.lost.set()
    await until(lambda: start_of_ways(known, "a", "b") is None)

    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
