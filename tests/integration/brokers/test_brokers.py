"""The same scenarios on both brokers: neither may know anything that the other does not."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from skyway.contracts.delivery_event import DeliveryEvent, DeliveryEventType
from skyway.contracts.drone_report import Ack, Connection
from skyway.contracts.instruction import ReportInstruction
from skyway.contracts.topics import (
    ACKS,
    CLOCK,
    CONNECTION,
    DELIVERY_EVENTS,
    INSTRUCTIONS,
    STATION_STATE,
)
from skyway.contracts.world import ClockAnchor, StationState
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt import Received
from skyway.runtime.mqtt_address import BrokerAddress
from skyway.runtime.mqtt_link import Login, MqttLink

NOW = datetime(2026, 1, 1, tzinfo=UTC)


def make_connection(number: int, status: str = "ONLINE") -> Connection:
    return Connection(
        message_id="m",
        sent_at=NOW,
        session=1,
        connection_number=number,
        status=status,  # type: ignore[arg-type]
    )


def make_ack(seq: int) -> Ack:
    return Ack(
        message_id="m",
        sent_at=NOW,
        session=1,
        seq=seq,
        instruction_id="i",
        instruction_seq=seq,
        stream=1,
        status="RECEIVED",
    )


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


def make_event(delivery_id: str) -> DeliveryEvent:
    return DeliveryEvent(
        message_id="m",
        sent_at=NOW,
        event_id="e",
        type=DeliveryEventType.REQUESTED,
        delivery_id=delivery_id,
        sequence=1,
        occurred_at=NOW,
    )


def make_anchor(rate: float) -> ClockAnchor:
    return ClockAnchor(message_id="m", sent_at=NOW, fleet_at=NOW, wall_at=NOW, rate=rate)


async def take(batches: AsyncIterator[list[Received[Any]]], wanted: int) -> list[Received[Any]]:
    """The next messages, in order; fails when there are more or fewer."""
    taken: list[Received[Any]] = []
    async with asyncio.timeout(10):
        while len(taken) < wanted:
            taken += await anext(batches)
    assert len(taken) == wanted
    return taken


async def all_connected(*clients: Any) -> None:
    async with asyncio.timeout(10):
        for client in clients:
            await client.wait_connected()


async def until(holds: Callable[[], bool]) -> None:
    async with asyncio.timeout(10):
        while not holds():  # noqa: ASYNC110 - the client has no event for every condition
            await asyncio.sleep(0.001)


async def test_a_drone_reads_only_its_own_instructions(broker, connect):
    composition = await connect(broker.service_port, "composition")
    drone = await connect(broker.port, "drone-1")
    arrived = drone.batches(INSTRUCTIONS)
    await all_connected(composition, drone)

    await composition.publish(INSTRUCTIONS("p", "drone-2"), make_instruction(1))
    await composition.publish(INSTRUCTIONS("p", "drone-1"), make_instruction(2))

    [received] = await take(arrived, 1)
    assert received.ids == ("p", "drone-1")
    assert received.message.seq == 2


async def test_a_drone_writes_only_its_own_topics(broker, connect):
    composition = await connect(broker.service_port, "composition")
    drone = await connect(broker.port, "drone-1")
    other = await connect(broker.port, "drone-2")
    arrived = composition.batches(ACKS)
    await all_connected(composition, drone, other)

    # Mosquitto acknowledges it and hangs up, the embedded broker only hangs up.
    with suppress(MqttUnavailable):
        await drone.publish(ACKS("p", "drone-2"), make_ack(1))
    await other.publish(ACKS("p", "drone-2"), make_ack(2))

    [received] = await take(arrived, 1)
    assert received.message.seq == 2


async def test_a_customer_reads_only_its_own_delivery_events(broker, connect):
    gateway = await connect(broker.service_port, "gateway")
    customer = await connect(broker.port, "customer-1")
    arrived = customer.batches(DELIVERY_EVENTS)
    await all_connected(gateway, customer)

    await gateway.publish(DELIVERY_EVENTS("customer-2", "d2"), make_event("d2"))
    await gateway.publish(DELIVERY_EVENTS("customer-1", "d1"), make_event("d1"))

    [received] = await take(arrived, 1)
    assert received.message.delivery_id == "d1"


async def test_the_operator_reads_everything_and_writes_nothing(broker, connect):
    operator = await connect(broker.service_port, "operator")
    composition = await connect(broker.service_port, "composition")
    gateway = await connect(broker.service_port, "gateway")
    drone = await connect(broker.port, "drone-1")
    arrived = operator.batches(INSTRUCTIONS, ACKS, DELIVERY_EVENTS, CLOCK)
    forged = drone.batches(INSTRUCTIONS)
    await all_connected(operator, composition, gateway, drone)

    await composition.publish(INSTRUCTIONS("p", "drone-1"), make_instruction(1))
    await drone.publish(ACKS("p", "drone-1"), make_ack(1))
    await gateway.publish(DELIVERY_EVENTS("customer-1", "d1"), make_event("d1"))
    await gateway.publish(CLOCK(), make_anchor(1.0))

    topics = [received.topic for received in await take(arrived, 4)]
    assert topics == [INSTRUCTIONS, ACKS, DELIVERY_EVENTS, CLOCK]
    with suppress(MqttUnavailable):
        await operator.publish(INSTRUCTIONS("p", "drone-1"), make_instruction(2))
    await composition.publish(INSTRUCTIONS("p", "drone-1"), make_instruction(3))
    assert [received.message.seq for received in await take(forged, 2)] == [1, 3]


@pytest.mark.parametrize("password", ["wrong", ""])
async def test_a_wrong_password_is_refused(broker, connect, password):
    link = MqttLink(
        Login("drone-1", "drone-1", password, 10), will=None, on_message=lambda *_: None
    )
    await all_connected(await connect(broker.port, "drone-2"))

    with pytest.raises(MqttUnavailable, match="refused"):
        await link.open(BrokerAddress("127.0.0.1", broker.port, is_encrypted=False))

    link.close()


async def test_nobody_is_anonymous(broker, connect):
    link = MqttLink(Login("anyone", "", "", 10), will=None, on_message=lambda *_: None)
    await all_connected(await connect(broker.port, "drone-2"))

    with pytest.raises(MqttUnavailable, match="refused"):
        await link.open(BrokerAddress("127.0.0.1", broker.port, is_encrypted=False))

    link.close()


@pytest.mark.parametrize("password", ["drone-2", "wrong"])
async def test_a_drone_under_anothers_client_id_does_not_disturb_it(broker, connect, password):
    greetings: list[str] = []

    async def greet() -> None:
        greetings.append("connected")

    composition = await connect(broker.service_port, "composition")
    victim = await connect(broker.port, "drone-1", on_connected=greet)
    arrived = victim.batches(INSTRUCTIONS("p", "drone-1"))
    await all_connected(composition, victim)
    thief = MqttLink(
        Login("drone-1", "drone-2", password, 10), will=None, on_message=lambda *_: None
    )

    with suppress(MqttUnavailable):
        await thief.open(BrokerAddress("127.0.0.1", broker.port, is_encrypted=False))
        await thief.subscribe({"#": 1})
    await composition.publish(INSTRUCTIONS("p", "drone-1"), make_instruction(1))

    await take(arrived, 1)
    assert victim.is_connected
    assert greetings == ["connected"]
    thief.close()


async def test_a_drones_next_connection_replaces_its_former_one(broker, connect, cable):
    composition = await connect(broker.service_port, "composition")
    told = composition.batches(CONNECTION)
    await all_connected(composition)
    wire = await cable(broker.port)
    await all_connected(
        await connect(
            wire.port,
            "drone-1",
            will=lambda: (CONNECTION("p", "drone-1"), make_connection(1, "LOST")),
        )
    )
    wire.go_silent()

    drone = await connect(broker.port, "drone-1")
    arrived = drone.batches(INSTRUCTIONS("p", "drone-1"))
    await all_connected(drone)
    await drone.publish(CONNECTION("p", "drone-1"), make_connection(2))
    await composition.publish(INSTRUCTIONS("p", "drone-1"), make_instruction(1))

    await take(arrived, 1)
    received = [one.message for one in await take(told, 2)]
    assert [one.connection_number for one in received] == [1, 2]
    assert [one.status for one in received] == ["LOST", "ONLINE"]


async def test_replicas_of_a_service_share_its_account(broker, connect):
    first = await connect(broker.service_port, "composition", client_id="composition-1")
    second = await connect(broker.service_port, "composition", client_id="composition-2")
    drone = await connect(broker.port, "drone-1")
    at_first, at_second = first.batches(ACKS), second.batches(ACKS)
    await all_connected(first, second, drone)

    await drone.publish(ACKS("p", "drone-1"), make_ack(1))

    await take(at_first, 1)
    await take(at_second, 1)


async def test_a_new_account_connects_and_a_removed_one_is_cut_off(broker, connect):
    greetings: list[str] = []

    async def greet() -> None:
        greetings.append("connected")

    composition = await connect(broker.service_port, "composition", on_connected=greet)
    removed = await connect(broker.port, "drone-1")
    fresh = await connect(broker.port, "drone-3")
    arrived = composition.batches(ACKS)
    await all_connected(composition, removed)

    await broker.set_accounts(("composition", "drone-2", "drone-3"))

    await all_connected(fresh)
    await fresh.publish(ACKS("p", "drone-3"), make_ack(3))
    [received] = await take(arrived, 1)
    assert received.ids == ("p", "drone-3")
    with pytest.raises(MqttUnavailable):
        await removed.publish(ACKS("p", "drone-1"), make_ack(1))
    assert greetings == ["connected"]


async def test_a_reader_that_comes_later_is_sent_what_is_retained(broker, connect):
    gateway = await connect(broker.service_port, "gateway")
    await all_connected(gateway)
    await gateway.publish(CLOCK(), make_anchor(1.0))
    await gateway.publish(CLOCK(), make_anchor(2.0))

    drone = await connect(broker.port, "drone-1")
    [received] = await take(drone.batches(CLOCK), 1)

    assert received.retained
    assert received.message.rate == 2.0


async def test_retained_topics_are_republished_after_the_broker_forgot_them(broker, connect):
    async def republish() -> None:
        await drone.publish(CONNECTION("p", "drone-1"), make_connection(1))

    composition = await connect(broker.service_port, "composition")
    arrived = composition.batches(CONNECTION)
    await all_connected(composition)
    drone = await connect(broker.port, "drone-1", on_connected=republish)
    await take(arrived, 1)

    await broker.stop()
    await until(lambda: not drone.is_connected)
    await broker.start()
    await all_connected(composition, drone)
    later = await connect(broker.service_port, "registry")

    [received] = await take(later.batches(CONNECTION), 1)
    assert received.ids == ("p", "drone-1")


async def test_a_lost_drone_is_told_with_its_present_connection_number(broker, connect, cable):
    wills: list[Connection] = []

    def make_will() -> tuple[Any, Connection]:
        wills.append(make_connection(len(wills) + 1, "LOST"))
        return CONNECTION("p", "drone-1"), wills[-1]

    composition = await connect(broker.service_port, "composition")
    arrived = composition.batches(CONNECTION)
    await all_connected(composition)
    wire = await cable(broker.port)
    drone = await connect(wire.port, "drone-1", will=make_will)
    await all_connected(drone)

    wire.cut()
    [first] = await take(arrived, 1)
    await until(lambda: len(wills) == 2)
    await all_connected(drone)
    wire.cut()
    [second] = await take(arrived, 1)

    assert (first.message.status, first.message.connection_number) == ("LOST", 1)
    assert (second.message.status, second.message.connection_number) == ("LOST", 2)


async def test_a_drone_that_says_goodbye_is_not_lost(broker, connect):
    composition = await connect(broker.service_port, "composition")
    arrived = composition.batches(CONNECTION)
    await all_connected(composition)
    drone = await connect(
        broker.port,
        "drone-1",
        will=lambda: (CONNECTION("p", "drone-1"), make_connection(1, "LOST")),
    )
    await all_connected(drone)

    await drone.__aexit__()
    other = await connect(broker.port, "drone-2")
    await all_connected(other)
    await other.publish(CONNECTION("p", "drone-2"), make_connection(1))

    [received] = await take(arrived, 1)
    assert received.ids == ("p", "drone-2")


async def test_a_silent_client_is_lost_after_one_and_a_half_keepalives(broker, connect, cable):
    composition = await connect(broker.service_port, "composition")
    arrived = composition.batches(CONNECTION)
    await all_connected(composition)
    wire = await cable(broker.port)
    drone = await connect(
        wire.port,
        "drone-1",
        will=lambda: (CONNECTION("p", "drone-1"), make_connection(1, "LOST")),
        keepalive_s=1,
    )
    await all_connected(drone)

    wire.go_silent()

    [received] = await take(arrived, 1)
    assert received.message.status == "LOST"


async def test_publish_says_so_when_the_broker_is_down(broker, connect):
    drone = await connect(broker.port, "drone-1")
    await all_connected(drone)
    await drone.publish(ACKS("p", "drone-1"), make_ack(1))

    await broker.stop()

    with pytest.raises(MqttUnavailable):
        await drone.publish(ACKS("p", "drone-1"), make_ack(2))


async def test_publish_does_not_wait_for_ever_for_a_silent_broker(broker, connect, cable):
    wire = await cable(broker.port)
    drone = await connect(wire.port, "drone-1")
    await all_connected(drone)
    wire.go_silent()

    with pytest.raises(MqttUnavailable, match="no PUBACK"):
        await drone.publish(ACKS("p", "drone-1"), make_ack(1), timeout_s=0.05)


async def test_subscriptions_are_renewed_when_the_broker_comes_back(broker, connect):
    composition = await connect(broker.service_port, "composition")
    drone = await connect(broker.port, "drone-1")
    arrived = composition.batches(ACKS)
    await all_connected(composition, drone)

    await broker.stop()
    await until(lambda: not composition.is_connected and not drone.is_connected)
    await broker.start()
    await all_connected(composition, drone)
    await drone.publish(ACKS("p", "drone-1"), make_ack(7))

    [received] = await take(arrived, 1)
    assert received.message.seq == 7


async def test_a_subscription_of_a_connected_client_takes_effect_at_once(broker, connect):
    composition = await connect(broker.service_port, "composition")
    drone = await connect(broker.port, "drone-1")
    await all_connected(composition, drone)

    arrived = composition.batches(ACKS)
    await all_connected(composition)
    await drone.publish(ACKS("p", "drone-1"), make_ack(1))

    await take(arrived, 1)


async def test_messages_arrive_in_the_order_they_were_sent(broker, connect):
    composition = await connect(broker.service_port, "composition")
    drone = await connect(broker.port, "drone-1")
    arrived = composition.batches(ACKS)
    await all_connected(composition, drone)

    await asyncio.gather(
        *(drone.publish(ACKS("p", "drone-1"), make_ack(seq)) for seq in range(2_000))
    )

    received = await take(arrived, 2_000)
    assert [one.message.seq for one in received] == list(range(2_000))


async def test_what_is_no_message_is_dropped_and_the_next_one_read(broker, connect):
    composition = await connect(broker.service_port, "composition")
    drone = await connect(broker.port, "drone-1")
    arrived = composition.batches(ACKS)
    await all_connected(composition, drone)

    name = ACKS("p", "drone-1").name
    await drone.publish_raw(name, b"{}", mqtt_qos=1, retained=False)
    await drone.publish_raw(name, b"\xff", mqtt_qos=1, retained=False)
    await drone.publish(ACKS("p", "drone-1"), make_ack(1))

    await take(arrived, 1)


async def test_a_stations_state_is_not_taken_for_a_drones(broker, connect):
    composition = await connect(broker.service_port, "composition")
    drone = await connect(broker.port, "drone-1")
    arrived = drone.batches(STATION_STATE)
    await all_connected(composition, drone)

    state = StationState(message_id="m", sent_at=NOW, station_id="s", pads=2, pads_taken=1)
    await composition.publish(STATION_STATE("s"), state)

    [received] = await take(arrived, 1)
    assert received.message.pads_taken == 1
