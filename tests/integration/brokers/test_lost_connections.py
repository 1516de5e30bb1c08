"""Connections that end on either side behave the same on both brokers."""

from typing import Any

import pytest

from skyway.contracts.drone_report import Connection
from skyway.contracts.topics import ACKS, CONNECTION, INSTRUCTIONS
from skyway.runtime.errors import MqttUnavailable, ServiceUnavailable


async def test_a_new_connection_of_a_drone_replaces_its_old_one(
    broker, connect, broker_proxy, make, receive, all_connected
):
    composition = await connect(broker.service_port, "composition")
    connections = composition.batches(CONNECTION)
    await all_connected(composition)
    proxy = await broker_proxy(broker.port)
    await all_connected(
        await connect(
            proxy.port,
            "p/drone-1",
            will=lambda: (CONNECTION("p", "drone-1"), make.connection(1, "LOST")),
        )
    )
    proxy.go_silent()

    drone = await connect(broker.port, "p/drone-1")
    arrived = drone.batches(INSTRUCTIONS("p", "drone-1"))
    await all_connected(drone)
    await drone.publish(CONNECTION("p", "drone-1"), make.connection(2))
    await composition.publish(INSTRUCTIONS("p", "drone-1"), make.instruction(1))

    await receive(arrived, 1)
    # NATS sends no last will for a connection that is replaced: the new one's word is enough.
    expected = [(1, "LOST"), (2, "ONLINE")] if broker.sends_will_of_replaced else [(2, "ONLINE")]
    received = [one.message for one in await receive(connections, len(expected))]
    assert [(one.connection_number, one.status) for one in received] == expected


async def test_a_greeting_that_meets_trouble_is_repeated(broker, connect, all_connected, until):
    tries = []

    async def greet() -> None:
        tries.append("greeting")
        if len(tries) < 3:
            raise ServiceUnavailable("database", "it is away in this test")

    await all_connected(await connect(broker.port, "p/drone-1", on_connected=greet))

    await until(lambda: len(tries) == 3)


async def test_retained_topics_are_republished_after_the_broker_lost_them(
    broker, connect, make, receive, all_connected, until
):
    async def republish() -> None:
        await drone.publish(CONNECTION("p", "drone-1"), make.connection(1))

    composition = await connect(broker.service_port, "composition")
    arrived = composition.batches(CONNECTION)
    await all_connected(composition)
    drone = await connect(broker.port, "p/drone-1", on_connected=republish)
    await receive(arrived, 1)

    await broker.stop()
    await drone.wait_lost()
    assert not drone.is_connected
    await broker.start()
    await all_connected(composition, drone)
    later = await connect(broker.service_port, "registry")

    [received] = await receive(later.batches(CONNECTION), 1)
    assert received.ids == ("p", "drone-1")


async def test_the_last_will_carries_the_present_connection_number(
    broker, connect, broker_proxy, make, receive, all_connected, until
):
    wills: list[Connection] = []

    def make_will() -> tuple[Any, Connection]:
        wills.append(make.connection(len(wills) + 1, "LOST"))
        return CONNECTION("p", "drone-1"), wills[-1]

    composition = await connect(broker.service_port, "composition")
    arrived = composition.batches(CONNECTION)
    await all_connected(composition)
    proxy = await broker_proxy(broker.port)
    drone = await connect(proxy.port, "p/drone-1", will=make_will)
    await all_connected(drone)

    proxy.cut()
    [first] = await receive(arrived, 1)
    await until(lambda: len(wills) == 2)
    await all_connected(drone)
    proxy.cut()
    [second] = await receive(arrived, 1)

    assert (first.message.status, first.message.connection_number) == ("LOST", 1)
    assert (second.message.status, second.message.connection_number) == ("LOST", 2)


async def test_a_drone_that_disconnects_in_order_is_not_reported_lost(
    broker, connect, make, receive, all_connected
):
    composition = await connect(broker.service_port, "composition")
    arrived = composition.batches(CONNECTION)
    await all_connected(composition)
    drone = await connect(
        broker.port,
        "p/drone-1",
        will=lambda: (CONNECTION("p", "drone-1"), make.connection(1, "LOST")),
    )
    await all_connected(drone)

    await drone.__aexit__()
    other = await connect(broker.port, "p/drone-2")
    await all_connected(other)
    await other.publish(CONNECTION("p", "drone-2"), make.connection(1))

    [received] = await receive(arrived, 1)
    assert received.ids == ("p", "drone-2")


async def test_a_silent_client_is_lost_after_one_and_a_half_keepalives(
    broker, connect, broker_proxy, make, receive, all_connected
):
    composition = await connect(broker.service_port, "composition")
    arrived = composition.batches(CONNECTION)
    await all_connected(composition)
    proxy = await broker_proxy(broker.port)
    drone = await connect(
        proxy.port,
        "p/drone-1",
        will=lambda: (CONNECTION("p", "drone-1"), make.connection(1, "LOST")),
        keepalive_s=1,
    )
    await all_connected(drone)

    proxy.go_silent()

    [received] = await receive(arrived, 1)
    assert received.message.status == "LOST"


async def test_publish_raises_when_the_broker_is_down(broker, connect, make, all_connected):
    drone = await connect(broker.port, "p/drone-1")
    await all_connected(drone)
    await drone.publish(ACKS("p", "drone-1"), make.ack(1))

    await broker.stop()

    with pytest.raises(MqttUnavailable):
        await drone.publish(ACKS("p", "drone-1"), make.ack(2))


async def test_publish_times_out_when_the_broker_is_silent(
    broker, connect, broker_proxy, make, all_connected
):
    proxy = await broker_proxy(broker.port)
    drone = await connect(proxy.port, "p/drone-1")
    await all_connected(drone)
    proxy.go_silent()

    with pytest.raises(MqttUnavailable, match="no PUBACK"):
        await drone.publish(ACKS("p", "drone-1"), make.ack(1), timeout_s=0.05)


async def test_subscriptions_are_renewed_when_the_broker_comes_back(
    broker, connect, make, receive, all_connected, until
):
    composition = await connect(broker.service_port, "composition")
    drone = await connect(broker.port, "p/drone-1")
    arrived = composition.batches(ACKS)
    await all_connected(composition, drone)

    await broker.stop()
    await until(lambda: not composition.is_connected and not drone.is_connected)
    await broker.start()
    await all_connected(composition, drone)
    await drone.publish(ACKS("p", "drone-1"), make.ack(7))

    [received] = await receive(arrived, 1)
    assert received.message.seq == 7
