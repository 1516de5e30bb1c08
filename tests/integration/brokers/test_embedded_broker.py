"""Each security hole of amqtt's own broker is closed, and no client can disturb the others."""

import asyncio
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from skyway.contracts.drone_report import Connection
from skyway.contracts.instruction import ReportInstruction
from skyway.contracts.topics import CLOCK, CONNECTION, INSTRUCTIONS
from skyway.contracts.world import ClockAnchor
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt.address import BrokerAddress
from skyway.runtime.mqtt.connection import Login, MqttConnection, RawMessage

NOW = datetime(2026, 1, 1, tzinfo=UTC)
ANCHOR = ClockAnchor(message_id="m", sent_at=NOW, fleet_at=NOW, wall_at=NOW, rate=1.0)
ONLINE = Connection(message_id="m", sent_at=NOW, session=1, connection_number=1, status="ONLINE")


def make_instruction(seq: int) -> ReportInstruction:
    return ReportInstruction(
        message_id="m",
        sent_at=NOW,
        instruction_id=f"i{seq}",
        stream=1,
        seq=seq,
        expires_at=NOW + timedelta(minutes=1),
        events_after_seq=0,
    )


class Listening:
    """A plain connection that records the topic of every message it receives."""

    def __init__(self, user_name: str, *, will: RawMessage | None = None) -> None:
        self.names: list[str] = []
        self._news = asyncio.Event()
        self.link = MqttConnection(
            Login(user_name, user_name, user_name, 10), will=will, on_message=self._arrived
        )

    def _arrived(self, name: str, _payload: bytes, _retained: bool) -> None:
        self.names.append(name)
        self._news.set()

    async def open(self, port: int) -> None:
        await self.link.open(BrokerAddress("127.0.0.1", port, is_encrypted=False))

    async def until_sent(self, name: str, *, times: int = 1) -> None:
        async with asyncio.timeout(60):
            while self.names.count(name) < times:
                self._news.clear()
                await self._news.wait()


async def connected(client: Any) -> Any:
    async with asyncio.timeout(60):
        await client.wait_connected()
    return client


async def test_a_connecting_client_receives_only_topics_that_it_subscribed_to(embedded, connect):
    registry = await connect(embedded.port, "registry")
    registry.batches(CONNECTION)
    drone = await connected(await connect(embedded.port, "p/drone-1"))
    gateway = await connected(await connect(embedded.port, "gateway"))
    await connected(registry)
    await drone.publish(CONNECTION("p", "drone-1"), ONLINE)

    other = Listening("registry")
    await other.open(embedded.port)
    await other.link.subscribe({CLOCK().name: 1})
    await gateway.publish(CLOCK(), ANCHOR)

    await other.until_sent(CLOCK().name)
    assert other.names == [CLOCK().name]
    other.link.close()


async def test_retained_messages_are_sent_within_the_clients_rights(embedded, connect):
    drone = await connected(await connect(embedded.port, "p/drone-1"))
    gateway = await connected(await connect(embedded.port, "gateway"))
    await drone.publish(CONNECTION("p", "drone-1"), ONLINE)
    await gateway.publish(CLOCK(), ANCHOR)

    other = Listening("p/drone-2")
    await other.open(embedded.port)
    await other.link.subscribe({"#": 1})

    await other.until_sent(CLOCK().name)
    assert other.names == [CLOCK().name]
    other.link.close()


async def test_a_last_will_needs_the_write_right_of_its_client(embedded, connect, broker_proxy):
    registry = await connect(embedded.port, "registry")
    arrived = registry.batches(CONNECTION)
    witness = await connect(embedded.port, "p/drone-2")
    await connected(registry)
    await connected(witness)
    proxy = await broker_proxy(embedded.port)
    payload = ONLINE.model_dump_json().encode()
    forged = RawMessage(CONNECTION("p", "drone-2").name, payload, 1, True)
    drone = Listening("p/drone-1", will=forged)
    await drone.open(proxy.port)

    proxy.cut()
    # drone-1 can connect again only after the broker has closed its old connection.
    again = await connected(await connect(embedded.port, "p/drone-1"))
    await again.publish(CONNECTION("p", "drone-1"), ONLINE)

    [received] = await anext(arrived)
    assert received.ids == ("p", "drone-1")
    late = await connect(embedded.port, "operator/olga")
    [retained] = await anext(late.batches(CONNECTION))
    assert retained.ids == ("p", "drone-1")
    drone.link.close()


async def test_many_clients_that_connect_and_leave_disturb_no_other_client(embedded, connect):
    composition = await connected(await connect(embedded.port, "composition"))
    drone = Listening("p/drone-1")
    await drone.open(embedded.port)
    await drone.link.subscribe({INSTRUCTIONS("p", "drone-1").name: 1})

    async def come_and_go() -> None:
        visitor = Listening("p/drone-2")
        try:
            await visitor.open(embedded.port)
            await visitor.link.subscribe({"#": 1, "skyway/v1/+/+/instructions": 0})
        except MqttUnavailable:
            pass  # replaced by the next visitor of the same name
        visitor.link.close()

    async with asyncio.TaskGroup() as tasks:
        for seq in range(1, 101):
            tasks.create_task(come_and_go())
            tasks.create_task(
                composition.publish(INSTRUCTIONS("p", "drone-1"), make_instruction(seq))
            )

    await drone.until_sent(INSTRUCTIONS("p", "drone-1").name, times=100)
    assert not drone.link.lost.done()
    drone.link.close()


@pytest.mark.parametrize(
    "nonsense",
    [
        b"GET / HTTP/1.1\r\n\r\n",
        b"\x10\x00",
        b"\x10\x0c\x00\x04MQTT\x04\x02\x00\x0a\x00\x00",
        b"\x30\xff\xff\xff\xff\xff",
        bytes(range(256)),
    ],
)
async def test_malformed_bytes_end_only_their_own_connection(embedded, connect, nonsense):
    drone = await connected(await connect(embedded.port, "p/drone-1"))

    reader, writer = await asyncio.open_connection("127.0.0.1", embedded.port)
    writer.write(nonsense)
    writer.write_eof()
    async with asyncio.timeout(60):
        await reader.read()
    writer.close()

    await drone.publish(CONNECTION("p", "drone-1"), ONLINE)


async def test_a_packet_above_the_limit_ends_its_connection(embedded, connect):
    drone = await connected(await connect(embedded.port, "p/drone-1"))

    with pytest.raises(MqttUnavailable):
        await drone.publish_raw(
            CONNECTION("p", "drone-1").name, bytes(2 << 20), mqtt_qos=1, retained=False
        )


async def test_a_change_of_accounts_takes_effect_immediately(embedded, connect):
    await connected(await connect(embedded.port, "p/drone-1"))
    fresh, removed = Listening("p/drone-3"), Listening("p/drone-1")

    await embedded.set_accounts(("p/drone-3",))

    await fresh.open(embedded.port)
    with pytest.raises(MqttUnavailable, match="refused"):
        await removed.open(embedded.port)
    fresh.link.close()
    removed.link.close()
