"""Who may connect, read and write is the same on both brokers."""

from contextlib import suppress

import pytest

from skyway.contracts.topics import (
    ACKS,
    CLOCK,
    DELIVERY_EVENTS,
    INSTRUCTIONS,
    STATE,
    STATION_STATE,
)
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt.address import BrokerAddress
from skyway.runtime.mqtt.connection import Login, MqttConnection


async def test_a_drone_reads_only_its_own_instructions(
    broker, connect, make, receive, all_connected
):
    composition = await connect(broker.service_port, "composition")
    drone = await connect(broker.port, "p/drone-1")
    # NATS refuses the first filter, because it is wider than the drone's rights.
    drone.batches(INSTRUCTIONS)
    drone.batches(INSTRUCTIONS("p", "drone-2"))
    arrived = drone.batches(INSTRUCTIONS("p", "drone-1"))
    await all_connected(composition, drone)

    await composition.publish(INSTRUCTIONS("p", "drone-2"), make.instruction(1))
    await composition.publish(INSTRUCTIONS("p", "drone-1"), make.instruction(2))

    [received] = await receive(arrived, 1)
    assert received.ids == ("p", "drone-1")
    assert received.message.seq == 2


async def test_a_drone_writes_only_its_own_topics(broker, connect, make, receive, all_connected):
    composition = await connect(broker.service_port, "composition")
    drone = await connect(broker.port, "p/drone-1")
    other = await connect(broker.port, "p/drone-2")
    arrived = composition.batches(ACKS)
    await all_connected(composition, drone, other)

    # Mosquitto acknowledges it and hangs up, the embedded broker only hangs up.
    with suppress(MqttUnavailable):
        await drone.publish(ACKS("p", "drone-2"), make.ack(1))
    await other.publish(ACKS("p", "drone-2"), make.ack(2))

    [received] = await receive(arrived, 1)
    assert received.message.seq == 2


async def test_a_customer_reads_only_its_own_delivery_events(
    broker, connect, make, receive, all_connected
):
    gateway = await connect(broker.service_port, "gateway")
    customer = await connect(broker.port, "customer-1")
    # NATS refuses the first filter, because it is wider than the customer's rights.
    customer.batches(DELIVERY_EVENTS)
    arrived = customer.batches(DELIVERY_EVENTS("customer-1", "d1"))
    await all_connected(gateway, customer)

    await gateway.publish(DELIVERY_EVENTS("customer-2", "d2"), make.event("d2"))
    await gateway.publish(DELIVERY_EVENTS("customer-1", "d1"), make.event("d1"))

    [received] = await receive(arrived, 1)
    assert received.message.delivery_id == "d1"


async def test_the_operator_reads_everything_and_writes_nothing(
    broker, connect, make, receive, all_connected
):
    operator = await connect(broker.port, "operator/olga")
    composition = await connect(broker.service_port, "composition")
    gateway = await connect(broker.service_port, "gateway")
    drone = await connect(broker.port, "p/drone-1")
    arrived = operator.batches(INSTRUCTIONS, ACKS, DELIVERY_EVENTS, CLOCK)
    forged = drone.batches(INSTRUCTIONS("p", "drone-1"))
    await all_connected(operator, composition, gateway, drone)

    await composition.publish(INSTRUCTIONS("p", "drone-1"), make.instruction(1))
    await drone.publish(ACKS("p", "drone-1"), make.ack(1))
    await gateway.publish(DELIVERY_EVENTS("customer-1", "d1"), make.event("d1"))
    await gateway.publish(CLOCK(), make.anchor(1.0))

    # Messages of different senders may overtake each other.
    topics = sorted(received.topic.template for received in await receive(arrived, 4))
    assert topics == sorted(each.template for each in (INSTRUCTIONS, ACKS, DELIVERY_EVENTS, CLOCK))
    with suppress(MqttUnavailable):
        await operator.publish(INSTRUCTIONS("p", "drone-1"), make.instruction(2))
    await composition.publish(INSTRUCTIONS("p", "drone-1"), make.instruction(3))
    assert [received.message.seq for received in await receive(forged, 2)] == [1, 3]


@pytest.mark.parametrize("password", ["wrong", ""])
async def test_a_wrong_password_is_refused(broker, connect, password, all_connected):
    link = MqttConnection(
        Login("p/drone-1", "p/drone-1", password, 10), will=None, on_message=lambda *_: None
    )
    await all_connected(await connect(broker.port, "p/drone-2"))

    with pytest.raises(MqttUnavailable, match="refused"):
        await link.open(BrokerAddress("127.0.0.1", broker.port, is_encrypted=False))

    link.close()


async def test_anonymous_clients_are_refused(broker, connect, all_connected):
    link = MqttConnection(Login("anyone", "", "", 10), will=None, on_message=lambda *_: None)
    await all_connected(await connect(broker.port, "p/drone-2"))

    with pytest.raises(MqttUnavailable, match="refused"):
        await link.open(BrokerAddress("127.0.0.1", broker.port, is_encrypted=False))

    link.close()


@pytest.mark.parametrize("password", ["p/drone-2", "wrong"])
async def test_a_drone_under_anothers_client_id_does_not_disturb_it(
    broker, connect, password, make, receive, all_connected
):
    greetings: list[str] = []

    async def greet() -> None:
        greetings.append("connected")

    composition = await connect(broker.service_port, "composition")
    victim = await connect(broker.port, "p/drone-1", on_connected=greet)
    arrived = victim.batches(INSTRUCTIONS("p", "drone-1"))
    await all_connected(composition, victim)
    thief = MqttConnection(
        Login("p/drone-1", "p/drone-2", password, 10), will=None, on_message=lambda *_: None
    )

    with suppress(MqttUnavailable):
        await thief.open(BrokerAddress("127.0.0.1", broker.port, is_encrypted=False))
        await thief.subscribe({"#": 1})
    await composition.publish(INSTRUCTIONS("p", "drone-1"), make.instruction(1))

    await receive(arrived, 1)
    assert victim.is_connected
    assert greetings == ["connected"]
    thief.close()


async def test_replicas_of_a_service_share_its_account(
    broker, connect, make, receive, all_connected
):
    first = await connect(broker.service_port, "composition", client_id="composition-1")
    second = await connect(broker.service_port, "composition", client_id="composition-2")
    drone = await connect(broker.port, "p/drone-1")
    at_first, at_second = first.batches(ACKS), second.batches(ACKS)
    await all_connected(first, second, drone)

    await drone.publish(ACKS("p", "drone-1"), make.ack(1))

    await receive(at_first, 1)
    await receive(at_second, 1)


async def test_a_new_account_connects_and_a_removed_one_is_cut_off(
    broker, connect, make, receive, all_connected
):
    greetings: list[str] = []

    async def greet() -> None:
        greetings.append("connected")

    composition = await connect(broker.service_port, "composition", on_connected=greet)
    removed = await connect(broker.port, "p/drone-1")
    fresh = await connect(broker.port, "p/drone-3")
    arrived = composition.batches(ACKS)
    await all_connected(composition, removed)

    await broker.set_accounts(("composition", "p/drone-2", "p/drone-3"))

    await all_connected(fresh)
    await fresh.publish(ACKS("p", "drone-3"), make.ack(3))
    [received] = await receive(arrived, 1)
    assert received.ids == ("p", "drone-3")
    with pytest.raises(MqttUnavailable):
        await removed.publish(ACKS("p", "drone-1"), make.ack(1))
    assert greetings == ["connected"]


@pytest.mark.parametrize(
    ("account", "topic"),
    [
        ("station-1", STATION_STATE("station-1")),
        ("station-1", STATE("stations", "station-1")),
        ("drone-1", ACKS("p", "drone-1")),
        ("drone-1", ACKS("drone-1", "drone-1")),
        ("p/drone-1", STATE("stations", "drone-1")),
        ("p/drone-1", ACKS("q", "drone-1")),
    ],
)
async def test_nobody_writes_in_the_name_of_a_namesake(
    broker, connect, make, receive, all_connected, account, topic
):
    operator = await connect(broker.port, "operator/olga")
    namesake = await connect(broker.port, account)
    drone = await connect(broker.port, "p/drone-2")
    arrived = operator.batches(ACKS, STATE, STATION_STATE)
    await all_connected(operator, namesake, drone)

    with suppress(MqttUnavailable):
        await namesake.publish_raw(topic.name, b"{}", mqtt_qos=1, retained=True)
    await drone.publish(ACKS("p", "drone-2"), make.ack(7))

    [received] = await receive(arrived, 1)
    assert received.message.seq == 7
