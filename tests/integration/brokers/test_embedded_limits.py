"""What one client, one account and one address may use of the embedded broker."""

import asyncio
import dataclasses
from typing import Any

import pytest
from skyway_broker.limits import Limits

from skyway.contracts.topics import ACKS, CONNECTION, INSTRUCTIONS, STATE
from skyway.runtime.limits import Budget

LIMITS = Limits()
CONNECTED = bytes((0x20, 2, 0, 0))
TRY_LATER = bytes((0x20, 2, 0, 3))
NOT_AUTHORIZED = bytes((0x20, 2, 0, 5))


def text(value: str) -> bytes:
    return len(value).to_bytes(2, "big") + value.encode()


def packet(first: int, body: bytes) -> bytes:
    length, size = b"", len(body)
    while True:
        size, low = divmod(size, 128)
        length += bytes((low | (0x80 if size else 0),))
        if not size:
            return bytes((first,)) + length + body


def connect_packet(
    user_name: str, password: str | None = None, *, keepalive_s: int = 0, version: int = 4
) -> bytes:
    properties = b"\x00" if version == 5 else b""
    head = text("MQTT") + bytes((version, 0xC2)) + keepalive_s.to_bytes(2, "big") + properties
    return packet(0x10, head + text(user_name) + text(user_name) + text(password or user_name))


def subscribe_packet(*filters: str) -> bytes:
    return packet(0x82, b"\x00\x01" + b"".join(text(each) + b"\x00" for each in filters))


class Raw:
    """A connection that sends bytes."""

    def __init__(self, port: int) -> None:
        self._port = port

    async def __aenter__(self) -> "Raw":
        self.reader, self.writer = await asyncio.open_connection("127.0.0.1", self._port)
        return self

    async def __aexit__(self, *_: object) -> None:
        self.writer.transport.abort()

    def pause(self) -> None:
        """Read nothing from now on."""
        assert isinstance(self.writer.transport, asyncio.Transport)
        self.writer.transport.pause_reading()

    def resume(self) -> None:
        """Read again."""
        assert isinstance(self.writer.transport, asyncio.Transport)
        self.writer.transport.resume_reading()

    async def ask(self, data: bytes, answer_bytes: int) -> bytes:
        self.writer.write(data)
        async with asyncio.timeout(60):
            return await self.reader.readexactly(answer_bytes)

    async def wait_closed(self) -> None:
        async with asyncio.timeout(60):
            try:
                while await self.reader.read(65536):
                    pass
            except ConnectionResetError:
                pass


@pytest.mark.parametrize(
    ("first", "answer"),
    [
        (connect_packet("p/drone-1", version=5), bytes((0x20, 3, 0, 0x84, 0))),
        (connect_packet("p/drone-1", version=6), bytes((0x20, 2, 0, 1))),
        (packet(0x10, text("MQIsdp") + bytes((3, 2, 0, 0)) + text("x")), bytes((0x20, 2, 0, 1))),
    ],
)
async def test_another_version_of_mqtt_is_refused_with_an_answer(embedded, first, answer):
    async with Raw(embedded.port) as client:
        assert await client.ask(first, len(answer)) == answer
        await client.wait_closed()


async def test_a_connect_above_its_limit_is_refused_before_it_has_come(limited):
    broker = await limited(dataclasses.replace(LIMITS, introduction_s=600))
    async with Raw(broker.port) as client:
        client.writer.write(bytes((0x10, 0xFF, 0xFF, 0x03)) + text("MQTT"))

        await client.wait_closed()


async def test_a_subscribe_above_its_limit_ends_the_connection(embedded):
    async with Raw(embedded.port) as client:
        await client.ask(connect_packet("p/drone-1"), 4)
        client.writer.write(subscribe_packet(*["a/b/c"] * 5_000))

        await client.wait_closed()


@pytest.mark.parametrize("sent", [b"", bytes((0x30, 100)) + text("half of a topic")])
async def test_a_silent_client_and_half_a_packet_are_ended_without_a_keepalive(limited, sent):
    broker = await limited(dataclasses.replace(LIMITS, silence_s=0.5, packet_s=0.5))
    async with Raw(broker.port) as client:
        await client.ask(connect_packet("p/drone-1"), 4)
        client.writer.write(sent)

        await client.wait_closed()


async def test_a_connection_without_a_connect_is_ended(limited):
    broker = await limited(dataclasses.replace(LIMITS, introduction_s=0.5))
    async with Raw(broker.port) as client:
        client.writer.write(connect_packet("p/drone-1")[:-1])

        await client.wait_closed()


async def test_filters_above_the_limit_and_long_filters_are_refused_alone(limited):
    account = dataclasses.replace(LIMITS.client, filters=2)
    broker = await limited(dataclasses.replace(LIMITS, client=account))
    deep, long = "/".join("abcdefghijklm"), "x" * 513
    async with Raw(broker.port) as client:
        await client.ask(connect_packet("p/drone-1"), 4)

        answer = await client.ask(subscribe_packet(deep, long, "a", "b", "a", "c"), 10)

    assert answer[4:] == bytes((0x80, 0x80, 0, 0, 0, 0x80))


async def test_a_client_that_does_not_read_is_put_out_and_others_are_served(
    limited, connect, make, receive, all_connected
):
    account = dataclasses.replace(LIMITS.client, waiting_bytes=100_000)
    broker = await limited(dataclasses.replace(LIMITS, client=account))
    composition = await connect(broker.port, "composition")
    drone = await connect(broker.port, "p/drone-2")
    arrived = drone.batches(INSTRUCTIONS("p", "drone-2"))
    await all_connected(composition, drone)
    async with Raw(broker.port) as slow:
        await slow.ask(connect_packet("p/drone-1"), 4)
        await slow.ask(subscribe_packet("#"), 5)
        slow.pause()
        for _ in range(20):
            await composition.publish_raw(
                INSTRUCTIONS("p", "drone-1").name, bytes(900_000), mqtt_qos=1, retained=False
            )
        await composition.publish(INSTRUCTIONS("p", "drone-2"), make.instruction(1))

        await receive(arrived, 1)
        slow.resume()
        await slow.wait_closed()


async def test_when_too_much_waits_in_all_the_slowest_reader_is_put_out(limited, connect, until):
    broker = await limited(dataclasses.replace(LIMITS, waiting_bytes=100_000))
    composition = await connect(broker.port, "composition")
    await composition.wait_connected()
    async with Raw(broker.port) as slow:
        await slow.ask(connect_packet("p/drone-1"), 4)
        await slow.ask(subscribe_packet("#"), 5)
        slow.pause()
        for _ in range(8):
            await composition.publish_raw(
                INSTRUCTIONS("p", "drone-1").name, bytes(900_000), mqtt_qos=1, retained=False
            )

        def is_put_out() -> bool:
            slow.writer.write(b"\xc0\x00")
            return slow.writer.is_closing()

        await until(is_put_out)


async def test_a_drone_above_its_budget_is_slowed_and_loses_nothing(
    limited, connect, make, receive, all_connected
):
    account = dataclasses.replace(LIMITS.client, packets=Budget("PACKETS", per_s=200, burst=10))
    broker = await limited(dataclasses.replace(LIMITS, client=account))
    composition = await connect(broker.port, "composition")
    drone = await connect(broker.port, "p/drone-1")
    arrived = composition.batches(ACKS)
    await all_connected(composition, drone)

    await asyncio.gather(*(drone.publish(ACKS("p", "drone-1"), make.ack(n)) for n in range(100)))

    received = await receive(arrived, 100)
    assert [each.message.seq for each in received] == list(range(100))


async def test_too_large_retained_messages_end_the_connection(limited, connect, make):
    account = dataclasses.replace(LIMITS.client, retained_bytes=1_000)
    broker = await limited(dataclasses.replace(LIMITS, client=account))
    async with Raw(broker.port) as client:
        await client.ask(connect_packet("p/drone-1"), 4)
        client.writer.write(packet(0x31, text(STATE("p", "drone-1").name) + bytes(1_001)))

        await client.wait_closed()
    drone = await connect(broker.port, "p/drone-1")
    await drone.wait_connected()
    await drone.publish(CONNECTION("p", "drone-1"), make.connection(1))


async def test_an_account_connects_so_often_and_no_other_account_is_refused(limited):
    account = dataclasses.replace(LIMITS.client, connects=Budget("CONNECTS", per_s=1e-6, burst=2))
    broker = await limited(dataclasses.replace(LIMITS, client=account))

    async def answer(user_name: str) -> bytes:
        async with Raw(broker.port) as client:
            return await client.ask(connect_packet(user_name), 4)

    answers = [await answer("p/drone-1") for _ in range(3)]

    assert answers == [CONNECTED, CONNECTED, TRY_LATER]
    assert await answer("p/drone-2") == CONNECTED


async def test_a_service_has_so_many_connections_and_may_replace_its_own(limited):
    account = dataclasses.replace(LIMITS.service, connections=1)
    broker = await limited(dataclasses.replace(LIMITS, service=account))

    def introduction(client_id: str) -> bytes:
        head = text("MQTT") + bytes((4, 0xC2, 0, 0))
        return packet(0x10, head + text(client_id) + text("gateway") + text("gateway"))

    async with Raw(broker.port) as first, Raw(broker.port) as other, Raw(broker.port) as again:
        assert await first.ask(introduction("1"), 4) == CONNECTED
        assert await other.ask(introduction("2"), 4) == TRY_LATER
        assert await again.ask(introduction("1"), 4) == CONNECTED


async def test_a_flood_of_wrong_passwords_does_not_keep_a_drone_out(
    embedded, connect, make, all_connected
):
    async def guess(number: int) -> bytes:
        async with Raw(embedded.port) as client:
            answer: bytes = await client.ask(connect_packet(f"p/drone-{number}", "wrong"), 4)
            return answer

    guesses = [asyncio.create_task(guess(number % 100 + 10)) for number in range(300)]
    drone: Any = await connect(embedded.port, "p/drone-1")
    await all_connected(drone)
    await drone.publish(CONNECTION("p", "drone-1"), make.connection(1))

    assert set(await asyncio.gather(*guesses)) == {NOT_AUTHORIZED}
