"""What Mosquitto's configuration bounds, and that its queue holds the messages of a minute."""

import asyncio
from typing import Any

import pytest

from skyway.broker_setup.mosquitto import PACKET_BYTES, QUEUED_BYTES
from skyway.contracts.topics import ACKS, INSTRUCTIONS
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt.address import BrokerAddress
from skyway.runtime.mqtt.connection import Login, MqttConnection

pytestmark = pytest.mark.integration

#: What a service misses in 60 s of 2,000 drones in flight: 0.15 messages a second from each.
OF_A_MINUTE = 18_000


async def is_let_in(port: int, name: str) -> bool:
    link = MqttConnection(Login(name, name, name, 10), will=None, on_message=lambda *_: None)
    try:
        async with asyncio.timeout(60):
            await link.open(BrokerAddress("127.0.0.1", port, is_encrypted=False))
    except MqttUnavailable:
        return False
    finally:
        link.close()
    return True


async def test_each_account_logs_in_at_its_own_listener_only(mosquitto: Any, connect: Any) -> None:
    await (await connect(mosquitto.service_port, "gateway")).wait_connected()
    people = ("p/drone-1", "customer-1", "operator/olga")
    services = ("composition", "registry")

    here = [name for name in (*people, *services) if await is_let_in(mosquitto.port, name)]
    there = [name for name in (*people, *services) if await is_let_in(mosquitto.service_port, name)]

    assert here == [*people]
    assert there == [*services]


async def test_a_packet_above_the_limit_ends_its_connection(mosquitto: Any, connect: Any) -> None:
    composition = await connect(mosquitto.service_port, "composition")
    await composition.wait_connected()

    with pytest.raises(MqttUnavailable):
        await composition.publish_raw(
            INSTRUCTIONS("p", "drone-1").name, bytes(PACKET_BYTES), mqtt_qos=1, retained=False
        )


async def test_a_slow_reader_cannot_use_up_the_memory(
    mosquitto: Any, connect: Any, broker_proxy: Any, make: Any, receive: Any
) -> None:
    composition = await connect(mosquitto.service_port, "composition")
    other = await connect(mosquitto.port, "p/drone-2")
    arrived = other.batches(INSTRUCTIONS("p", "drone-2"))
    proxy = await broker_proxy(mosquitto.port)
    slow = await connect(proxy.port, "p/drone-1")
    slow.batches(INSTRUCTIONS("p", "drone-1"))
    for client in (composition, other, slow):
        await client.wait_connected()
    proxy.pause()
    before = mosquitto.memory_bytes

    for _ in range(6 * QUEUED_BYTES // 1_000_000):
        await composition.publish_raw(
            INSTRUCTIONS("p", "drone-1").name, bytes(1_000_000), mqtt_qos=1, retained=False
        )
    await composition.publish(INSTRUCTIONS("p", "drone-2"), make.instruction(1))

    await receive(arrived, 1)
    assert mosquitto.memory_bytes - before < 2.5 * QUEUED_BYTES


@pytest.mark.long
async def test_the_queue_of_a_service_holds_the_messages_of_a_minute(
    mosquitto: Any, connect: Any, broker_proxy: Any, make: Any, receive: Any
) -> None:
    drone = await connect(mosquitto.port, "p/drone-1")
    proxy = await broker_proxy(mosquitto.service_port)
    # On a busy machine the pause may be long. A client that ends its connection loses its queue.
    composition = await connect(proxy.port, "composition", keepalive_s=600)
    arrived = composition.batches(ACKS)
    for client in (drone, composition):
        await client.wait_connected()
    proxy.pause()

    for first in range(0, OF_A_MINUTE, 1_000):
        await asyncio.gather(
            *(drone.publish(ACKS("p", "drone-1"), make.ack(n)) for n in range(first, first + 1_000))
        )
    proxy.resume()

    received = await receive(arrived, OF_A_MINUTE)
    assert [each.message.seq for each in received] == list(range(OF_A_MINUTE))
