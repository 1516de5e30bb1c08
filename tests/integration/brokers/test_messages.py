"""Messages arrive in the same way on both brokers."""

import asyncio

from skyway.contracts.topics import ACKS, CLOCK, STATION_STATE


async def test_a_later_reader_receives_the_retained_message(
    broker, connect, make, receive, all_connected
):
    gateway = await connect(broker.service_port, "gateway")
    await all_connected(gateway)
    await gateway.publish(CLOCK(), make.anchor(1.0))
    await gateway.publish(CLOCK(), make.anchor(2.0))

    drone = await connect(broker.port, "p/drone-1")
    [received] = await receive(drone.batches(CLOCK), 1)

    assert received.retained
    assert received.message.rate == 2.0


async def test_a_reader_that_subscribes_again_receives_the_retained_message_again(
    broker, connect, make, receive, all_connected
):
    gateway = await connect(broker.service_port, "gateway")
    await all_connected(gateway)
    await gateway.publish(CLOCK(), make.anchor(1.0))
    drone = await connect(broker.port, "p/drone-1")
    arrived = drone.batches(CLOCK)
    await receive(arrived, 1)

    drone.subscribe_again()

    [received] = await receive(arrived, 1)
    assert received.retained


async def test_a_reader_can_distinguish_live_and_retained_messages(
    broker, connect, make, receive, all_connected
):
    gateway = await connect(broker.service_port, "gateway")
    await all_connected(gateway)
    drone = await connect(broker.port, "p/drone-1")
    arrived = drone.batches(CLOCK)
    await all_connected(drone)

    await gateway.publish(CLOCK(), make.anchor(1.0))

    [received] = await receive(arrived, 1)
    assert not received.retained


async def test_a_subscription_of_a_connected_client_takes_effect_immediately(
    broker, connect, make, receive, all_connected
):
    composition = await connect(broker.service_port, "composition")
    drone = await connect(broker.port, "p/drone-1")
    await all_connected(composition, drone)

    arrived = composition.batches(ACKS)
    await all_connected(composition)
    await drone.publish(ACKS("p", "drone-1"), make.ack(1))

    await receive(arrived, 1)


async def test_messages_arrive_in_the_order_they_were_sent(
    broker, connect, make, receive, all_connected
):
    composition = await connect(broker.service_port, "composition")
    drone = await connect(broker.port, "p/drone-1")
    arrived = composition.batches(ACKS)
    await all_connected(composition, drone)

    await asyncio.gather(
        *(drone.publish(ACKS("p", "drone-1"), make.ack(seq)) for seq in range(2_000))
    )

    received = await receive(arrived, 2_000)
    assert [one.message.seq for one in received] == list(range(2_000))


async def test_an_unreadable_message_is_dropped_and_the_next_one_is_read(
    broker, connect, make, receive, all_connected
):
    composition = await connect(broker.service_port, "composition")
    drone = await connect(broker.port, "p/drone-1")
    arrived = composition.batches(ACKS)
    await all_connected(composition, drone)

    name = ACKS("p", "drone-1").name
    await drone.publish_raw(name, b"{}", mqtt_qos=1, retained=False)
    await drone.publish_raw(name, b"\xff", mqtt_qos=1, retained=False)
    await drone.publish(ACKS("p", "drone-1"), make.ack(1))

    await receive(arrived, 1)


async def test_the_state_of_a_station_is_not_mistaken_for_the_state_of_a_drone(
    broker, connect, make, receive, all_connected
):
    composition = await connect(broker.service_port, "composition")
    drone = await connect(broker.port, "p/drone-1")
    arrived = drone.batches(STATION_STATE)
    await all_connected(composition, drone)

    await composition.publish(STATION_STATE("s"), make.station_state(pads_taken=1))

    [received] = await receive(arrived, 1)
    assert received.message.pads_taken == 1
