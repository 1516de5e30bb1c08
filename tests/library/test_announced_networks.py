"""Announced networks are cached, and the cache is cleared when announcements may be missed."""

import asyncio
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import pytest

from skyway.announced_networks import CachedNetworks, NetworkLearner
from skyway.contracts.station_check import NetworkStations
from skyway.contracts.topics import Topic
from skyway.contracts.world import NetworkVersion
from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.runtime.mqtt.inbox import Received


def make_network(network_id: str = "city", *, version: int = 1, **parts: int) -> NetworkStations:
    """Stations by their part of the network."""
    return NetworkStations(
        network_id=NetworkId(network_id),
        version=version,
        station_ids=tuple(StationId(each) for each in parts),
        positions=tuple(Position(0.0, float(number)) for number in range(len(parts))),
        parts=tuple(parts.values()),
    )


def position_if_connected(cached: CachedNetworks, start: str, *ends: str) -> Position | None:
    return cached.position_if_connected(StationId(start), to=[StationId(end) for end in ends])


@pytest.fixture
def cached() -> CachedNetworks:
    """Two networks: a city with an island, and a town."""
    made = CachedNetworks()
    made.put(make_network(a=0, b=0, island=2))
    made.put(make_network("town", t=0))
    return made


def test_stations_in_one_part_of_a_network_are_connected(cached: CachedNetworks) -> None:
    assert position_if_connected(cached, "b", "a", "b") == Position(0.0, 1.0)


@pytest.mark.parametrize(
    ("start", "end"), [("a", "island"), ("a", "t"), ("a", "new"), ("new", "a")]
)
def test_other_stations_are_not_connected(cached: CachedNetworks, start: str, end: str) -> None:
    assert position_if_connected(cached, start, end) is None


def test_stations_are_listed_with_their_names_and_connected_areas(cached: CachedNetworks) -> None:
    named = make_network("town", version=2, t=0).model_copy(update={"names": {"t": "Market"}})
    cached.put(named)
    cached.drop(NetworkId("city"))  # the last version that is known stays listed

    listed = {each.station_id: (each.area, each.name) for each in cached.stations()}

    assert listed == {
        "a": (("city", 0), None),
        "b": (("city", 0), None),
        "island": (("city", 2), None),
        "t": (("town", 0), "Market"),
    }


@pytest.mark.parametrize(("station", "network"), [("island", "city"), ("t", "town"), ("new", None)])
def test_a_cached_station_has_one_network(
    cached: CachedNetworks, station: str, network: str | None
) -> None:
    assert cached.network_of(StationId(station)) == network


def test_a_new_version_replaces_the_old_one(cached: CachedNetworks) -> None:
    cached.put(make_network(version=2, b=0, c=0))

    assert cached.version_of(NetworkId("city")) == 2
    assert [cached.network_of(StationId(each)) for each in "abc"] == [None, "city", "city"]


def test_a_dropped_network_is_not_cached(cached: CachedNetworks) -> None:
    cached.drop(NetworkId("city"))

    assert cached.version_of(NetworkId("city")) is None
    assert [cached.network_of(StationId(each)) for each in "at"] == [None, "town"]


def test_the_last_version_of_a_dropped_network_is_still_known(cached: CachedNetworks) -> None:
    start, to = StationId("b"), [StationId("a")]
    cached.clear()

    assert cached.position_if_connected(start, to=to) is None
    assert cached.last_position_if_connected(start, to=to) == Position(0.0, 1.0)
    cached.put(make_network(version=2, b=0, c=0))
    assert cached.last_position_if_connected(start, to=to) is None


def test_a_network_that_is_too_large_is_cached_without_stations(cached: CachedNetworks) -> None:
    ids = tuple(StationId(f"s{number}") for number in range(199_997))
    large = NetworkStations(
        network_id=NetworkId("country"),
        version=1,
        station_ids=ids,
        positions=(Position(0.0, 0.0),) * len(ids),
        parts=(0,) * len(ids),
    )

    cached.put(large)

    assert cached.version_of(large.network_id) == 1
    assert cached.network_of(ids[0]) is None
    assert cached.network_of(StationId("a")) == "city"


def test_each_change_has_its_own_revision(cached: CachedNetworks) -> None:
    seen = [cached.revision]
    cached.put(make_network(version=2, a=0))
    seen.append(cached.revision)
    cached.drop(NetworkId("city"))
    seen.append(cached.revision)
    cached.clear()
    seen.append(cached.revision)

    assert len(set(seen)) == 4


@dataclass
class FakeComposition:
    """Composition that answers the stations of networks, and records the questions."""

    networks: dict[str, NetworkStations] = field(default_factory=dict)
    asked: list[str] = field(default_factory=list)

    async def all_stations(self, network_id: NetworkId) -> NetworkStations:
        self.asked.append(network_id)
        return self.networks[network_id]


def announcement(network_id: str = "city", *, version: int = 1) -> NetworkVersion:
    return NetworkVersion(
        message_id="msg_1",
        sent_at=datetime(2026, 3, 1, tzinfo=UTC),
        network_id=NetworkId(network_id),
        version=version,
        sha256="0" * 64,
        href="/",
    )


def is_cached(learner: NetworkLearner, station: str) -> bool:
    return learner.cached.network_of(StationId(station)) == "city"


@pytest.fixture
def composition() -> FakeComposition:
    return FakeComposition({"city": make_network(a=0, b=0)})


@pytest.fixture
def learner(composition: FakeComposition) -> NetworkLearner:
    return NetworkLearner(composition.all_stations)


async def test_a_cached_version_is_asked_for_once(
    learner: NetworkLearner, composition: FakeComposition
) -> None:
    learner.note(announcement())
    await learner.learn()
    learner.note(announcement())
    await learner.learn()

    assert is_cached(learner, "a")
    assert composition.asked == ["city"]


async def test_a_learned_version_is_kept_for_the_next_start(composition: FakeComposition) -> None:
    kept: list[NetworkStations] = []

    async def keep(stations: NetworkStations) -> None:
        kept.append(stations)

    learner = NetworkLearner(composition.all_stations, keep=keep)
    learner.note(announcement())
    await learner.learn()

    assert kept == [composition.networks["city"]]


async def test_a_replaced_version_leaves_the_cache_immediately(
    learner: NetworkLearner, composition: FakeComposition
) -> None:
    learner.note(announcement())
    await learner.learn()
    composition.networks["city"] = make_network(version=2, b=0, c=0)

    learner.note(announcement(version=2))
    before_it_was_learned = is_cached(learner, "b")
    await learner.learn()

    assert not before_it_was_learned
    assert [is_cached(learner, station) for station in "abc"] == [False, True, True]


async def test_an_answer_older_than_the_announcement_is_not_cached(
    learner: NetworkLearner,
) -> None:
    learner.note(announcement(version=2))
    await learner.learn()

    assert not is_cached(learner, "a")


async def test_nothing_is_cached_after_forget(learner: NetworkLearner) -> None:
    learner.note(announcement())
    await learner.learn()

    learner.forget()

    assert not is_cached(learner, "a")


async def test_a_network_that_is_answered_without_stations_is_asked_for_once(
    learner: NetworkLearner, composition: FakeComposition
) -> None:
    composition.networks["city"] = make_network()
    learner.note(announcement())
    await learner.learn()
    await learner.learn()

    assert composition.asked == ["city"]


class FakeMqtt:
    """An MQTT client as far as the learner uses it: messages, and whether it is connected."""

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
    async with asyncio.timeout(60):
        while not holds():  # noqa: ASYNC110 - no event is set when the condition holds
            await asyncio.sleep(0)


async def test_announced_networks_are_cached_until_the_connection_is_lost(
    learner: NetworkLearner,
) -> None:
    mqtt: Any = FakeMqtt()
    mqtt.connected.set()
    running = asyncio.create_task(learner.run(mqtt))

    mqtt.arrived.put_nowait(announcement())
    await until(lambda: is_cached(learner, "a"))
    mqtt.lost.set()
    await until(lambda: not is_cached(learner, "a"))

    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
