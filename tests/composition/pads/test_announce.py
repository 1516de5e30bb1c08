"""Stations and networks are published over MQTT on change, and all again after a connect."""

from dataclasses import dataclass, field
from datetime import timedelta
from typing import Any, cast

import pytest
from skyway_composition.networks.publish import NetworkVersions
from skyway_composition.pads.announce import StationStates
from skyway_composition.parts import Parts

from skyway.runtime.mqtt.client import MqttClient

OPERATOR = "operator:op"

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


@dataclass
class Broker:
    """Keeps what is published."""

    is_connected: bool = True
    published: list[tuple[str, Any]] = field(default_factory=list)

    async def publish(self, address: Any, message: Any) -> None:
        self.published.append((address.name, message))


def station_states(parts: Parts, broker: Broker) -> StationStates:
    mqtt = cast(MqttClient, broker)
    return StationStates(parts.db, mqtt, parts.clock, parts.mint, parts.own_cells)


def network_versions(parts: Parts, broker: Broker) -> NetworkVersions:
    mqtt = cast(MqttClient, broker)
    return NetworkVersions(parts.db, mqtt, parts.clock, parts.mint, parts.own_cells)


async def test_a_station_is_published_when_a_reservation_begins_and_ends(composition: Any) -> None:
    parts, broker = composition.parts, Broker()
    states = station_states(parts, broker)
    await composition.book()
    (first, *_) = [row for row in await composition.reservations() if row.station_id == "b"]
    now_ms = 1_772_366_400_000

    await states.step()
    parts.clock.advance(timedelta(milliseconds=first.start_ms - now_ms))
    await states.step()
    await states.step()
    parts.clock.advance(timedelta(milliseconds=first.end_ms - first.start_ms))
    await states.step()

    published = [
        (message.pads_taken, message.queue)
        for name, message in broker.published
        if name == "skyway/v1/stations/b/state"
    ]
    # Two sessions: on the way out and on the way home.
    assert published == [(0, 2), (1, 1), (0, 1)]


async def test_the_first_step_publishes_free_stations_too(composition: Any) -> None:
    parts, broker = composition.parts, Broker()

    await station_states(parts, broker).step()

    published = {name: message.pads_taken for name, message in broker.published}
    assert published["skyway/v1/stations/b/state"] == 0


async def test_after_a_connect_everything_is_published_again(composition: Any) -> None:
    parts, broker = composition.parts, Broker()
    states = station_states(parts, broker)
    versions = network_versions(parts, broker)
    await composition.book()
    parts.clock.advance(timedelta(hours=1))

    for _ in range(2):
        for published in (states, versions):
            published.forget()
            await published.step()
            await published.step()

    names = [name for name, _ in broker.published]
    assert names.count("skyway/v1/networks/row/version") == 2
    assert len(names) == 2 * len(set(names))


async def test_a_new_network_version_is_published(composition: Any, make: Any) -> None:
    parts, broker = composition.parts, Broker()
    versions = network_versions(parts, broker)

    await versions.step()
    await composition.publish(make.network(loading_s=1))
    await versions.step()

    assert [message.version for _, message in broker.published] == [1, 2]


async def test_without_a_broker_nothing_is_published(composition: Any) -> None:
    parts, broker = composition.parts, Broker(is_connected=False)

    await network_versions(parts, broker).step()
    await station_states(parts, broker).step()

    assert broker.published == []


async def test_a_station_is_published_when_a_pad_fails_and_works_again(composition: Any) -> None:
    parts, broker = composition.parts, Broker()
    states = station_states(parts, broker)
    path, operator = "/v1/stations/b/pads/0/outages", "operator:op"

    await states.step()
    made = await composition(operator, "POST", path)
    await states.step()
    await composition(operator, "DELETE", f"{path}/{made.json()['closure_id']}")
    await states.step()

    published = [
        (message.pads_taken, message.next_free_at)
        for name, message in broker.published
        if name == "skyway/v1/stations/b/state"
    ]
    assert published == [(0, None), (1, None), (0, None)]


async def test_a_reserved_pad_that_fails_is_free_when_outage_and_reservation_are_over(
    composition: Any,
) -> None:
    parts, broker = composition.parts, Broker()
    states = station_states(parts, broker)
    await composition.book()
    (first, *_) = [row for row in await composition.reservations() if row.station_id == "b"]
    parts.clock.advance(timedelta(milliseconds=first.start_ms - 1_772_366_400_000))
    until = parts.clock.now() + timedelta(days=1)

    path = f"/v1/stations/b/pads/{first.pad}/outages"
    await composition("operator:op", "POST", path, {"until": until.isoformat()})
    await states.step()

    published = [
        message for name, message in broker.published if name == "skyway/v1/stations/b/state"
    ]
    assert (published[-1].pads_taken, published[-1].next_free_at) == (1, until)


async def test_stations_and_versions_of_a_network_at_another_server_are_not_published(
    composition: Any, make: Any
) -> None:
    parts, broker = composition.parts, Broker()
    path = "/v1/networks/moved"
    assert (await composition(OPERATOR, "PUT", path, make.network(stations="xyz"))).is_success
    parts.own_cells.cells = {"moved": "http://other"}
    await parts.own_cells.read_database(parts.db)
    await station_states(parts, broker).step()
    await network_versions(parts, broker).step()

    published = {name for name, _ in broker.published}
    assert published == {
        *(f"skyway/v1/stations/{each}/state" for each in "abcde"),
        "skyway/v1/networks/row/version",
    }
