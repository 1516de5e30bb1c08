"""What a drone does, and does not do, while the cloud cannot be reached."""

from datetime import timedelta
from typing import Any

from skyway.contracts.topics import CONNECTION, STATE

PRE_START = timedelta(minutes=10)


async def test_loading_waits_for_the_link(world: Any, cloud: Any, trip: Any) -> None:
    await world.start()
    await world.send(cloud.mission(trip))
    world.link.cut()

    await world.pass_time(PRE_START + timedelta(minutes=30))
    assert world.events == []
    back_at = world.clock.now()
    world.link.connect()
    await world.pass_until(lambda: len(world.events) == 1)

    assert world.events[0].started_at == back_at


async def test_loading_waits_until_the_broker_confirms_the_acceptance(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    world.pubacks.clear()
    await world.send(cloud.mission(trip))

    await world.pass_time(PRE_START + timedelta(minutes=30))
    assert all(state.activity == "IDLE" for state in world.states)
    confirmed_at = world.clock.now()
    world.pubacks.set()
    await world.pass_until(lambda: len(world.events) == 1)

    assert world.events[0].started_at == confirmed_at


async def test_a_drone_that_lost_the_link_lands_and_waits_there(
    world: Any, cloud: Any, trip: Any
) -> None:
    world.clock.rate = 10.0
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: any(state.activity == "FLYING" for state in world.states))

    world.link.cut()
    await world.pass_time(timedelta(hours=5))
    back_at = world.clock.now()
    world.link.connect()
    await world.pass_until(lambda: world.is_over)

    landed, taken_off = world.events[2], world.events[5]
    assert landed.station_id == "shop"
    assert abs(landed.ended_at - trip[2].planned_end_at) < timedelta(milliseconds=1)
    assert world.events[4].step_kind == "RECHARGE"
    assert taken_off.started_at == back_at


async def test_a_link_that_blinks_delays_nothing(world: Any, cloud: Any, trip: Any) -> None:
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: len(world.events) == 4)

    world.link.cut()
    await world.pass_time(timedelta(seconds=600))
    world.link.connect()
    await world.pass_until(lambda: world.is_over)

    assert abs(world.events[-1].ended_at - trip[-1].planned_end_at) < timedelta(milliseconds=1)


async def test_presence_has_a_fresh_number_on_every_connection(world: Any) -> None:
    await world.start()
    world.link.cut()
    world.link.connect()
    await world.settle()
    await world.stop()

    reported = [(one.connection_number, one.status) for one in world.messages(CONNECTION)]
    assert list(dict.fromkeys(reported)) == [
        (1, "ONLINE"),
        (1, "LOST"),
        (2, "ONLINE"),
        (3, "OFFLINE"),
    ]
    assert len({one.session for one in world.messages(CONNECTION)}) == 1


async def test_the_state_is_sent_again_on_every_connection(world: Any) -> None:
    await world.start()
    before = len(world.states)

    world.link.cut()
    world.link.connect()
    await world.pass_time(timedelta(seconds=600))

    assert len(world.states) == before + 1
    assert (world.states[-1].stream, world.states[-1].last_instruction_seq) == (0, 0)


async def test_events_that_happened_without_a_link_are_sent_when_it_is_back(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: any(state.activity == "FLYING" for state in world.states))

    world.link.cut()
    await world.pass_time(timedelta(hours=1))
    world.link.connect()
    await world.pass_until(lambda: world.is_over)

    assert [event.seq for event in world.events] == list(range(1, 10))


async def test_an_unconfirmed_state_is_sent_again_with_current_values(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    await world.send(cloud.mission(trip))
    world.link.cut()
    await world.pass_time(timedelta(hours=1))
    before = len(world.states)

    world.link.connect()
    await world.pass_time(timedelta(seconds=300))

    assert len(world.states) > before
    assert world.states[before].at >= world.clock.now() - timedelta(seconds=300)
    assert STATE.retained


async def test_an_instruction_waits_until_fleet_time_is_set(
    world: Any, cloud: Any, trip: Any
) -> None:
    world.clock.is_set.clear()
    await world.start()
    await world.send(cloud.mission(trip))
    assert world.published == []

    world.clock.is_set.set()
    await world.settle()

    assert [one.status for one in world.messages(CONNECTION)] == ["ONLINE"]
    assert [ack.status for ack in world.acks] == ["RECEIVED", "ACCEPTED"]
