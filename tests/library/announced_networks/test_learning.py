"""Networks are learned when they are announced, and forgotten when nothing can be heard."""

import asyncio
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import pytest

from skyway.announced_networks.learning import NetworkLearner
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

    async def all_stations(self, network_id: NetworkId) -> NetworkStations:
        self.asked.append(network_id)
        return self.networks[network_id]


def make_network(*stations: str, version: int = 1) -> NetworkStations:
    return NetworkStations(
        network_id=NetworkId("city"),
        version=version,
        station_ids=tuple(StationId(each) for each in stations),
        positions=(Position(0.0, 0.0),) * len(stations),
        parts=(0,) * len(stations),
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


def is_known(learner: NetworkLearner, station: str) -> bool:
    return learner.known.network_of(StationId(station)) == "city"


@pytest.fixture
def composition() -> Told:
    return Told({"city": make_network("a", "b")})


@pytest.fixture
def learner(composition: Told) -> NetworkLearner:
    return NetworkLearner(composition.all_stations)


async def test_a_known_version_is_asked_for_once(
    learner: NetworkLearner, composition: Told
) -> None:
    learner.announce(announced())
    await learner.learn()
    learner.announce(announced())
    await learner.learn()

    assert is_known(learner, "a")
    assert composition.asked == ["city"]


async def test_nothing_counts_of_a_version_that_was_replaced(
    learner: NetworkLearner, composition: Told
) -> None:
    learner.announce(announced())
    await learner.learn()
    composition.networks["city"] = make_network("b", "c", version=2)

    learner.announce(announced(version=2))
    at_once = is_known(learner, "b")
    await learner.learn()

    assert not at_once
    assert [is_known(learner, station) for station in "abc"] == [False, True, True]


async def test_what_is_older_than_announced_is_not_kept(learner: NetworkLearner) -> None:
    learner.announce(announced(version=2))
    await learner.learn()

    assert not is_known(learner, "a")


async def test_nothing_is_known_while_nothing_could_be_heard(learner: NetworkLearner) -> None:
    learner.announce(announced())
    await learner.learn()

    learner.forget()

    assert not is_known(learner, "a")


async def test_a_network_that_is_not_told_is_asked_for_once(
    learner: NetworkLearner, composition: Told
) -> None:
    composition.networks["city"] = make_network()
    learner.announce(announced())
    await learner.learn()
    await learner.learn()

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
    learner: NetworkLearner,
) -> None:
    line: Any = Line()
    line.connected.set()
    running = asyncio.create_task(learner.run(line))

    line.arrived.put_nowait(announced())
    await until(lambda: is_known(learner, "a"))
    line.lost.set()
    await until(lambda: not is_known(learner, "a"))

    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
