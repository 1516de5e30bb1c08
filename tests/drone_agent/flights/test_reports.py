"""The messages that a drone sends about itself."""

from datetime import timedelta
from itertools import pairwise
from typing import Any

from skyway_drone_agent.link.link_monitor import Heartbeat, LinkMonitor

from skyway.contracts.topics import ACKS, EVENTS, STATE, TELEMETRY

PRE_START = timedelta(minutes=10)


async def test_the_state_is_sent_every_30_s_of_wall_time(world: Any) -> None:
    await world.start()
    before = len(world.states)

    await world.pass_time(timedelta(seconds=600 * 95))

    assert len(world.states) == before + 3


async def test_the_first_beat_is_one_state_though_the_sensors_were_read_shortly_before(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    connected = LinkMonitor(world.link, world.clock, on_change=lambda: None)
    beat = Heartbeat(world.drone.drone_id, connected, world.clock).after(world.clock.now())
    moment = timedelta(seconds=1)
    await world.pass_time(beat - moment - world.clock.now())
    await world.send(cloud.mission(trip))
    before = len(world.states)

    await world.pass_time(2 * moment)

    assert len(world.states) == before + 1


async def test_a_drone_that_connects_late_sends_its_state_once(world: Any) -> None:
    world.is_broker_up = False
    await world.start()
    world.pubacks.clear()

    world.link.connect()
    await world.pass_time(timedelta(seconds=600))
    # The broker is slow: it has the state before the drone knows that it has ONLINE.
    world.pubacks.set()
    await world.pass_time(timedelta(seconds=600))

    assert len(world.states) == 1


async def test_a_drone_that_reconnects_sends_its_state_once(world: Any) -> None:
    await world.start()
    world.link.cut()
    await world.settle()
    before = len(world.states)

    world.link.connect()
    await world.pass_time(timedelta(seconds=600))

    assert len(world.states) == before + 1


async def test_states_are_numbered_upwards_and_name_the_mission(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    await world.send(cloud.mission(trip))

    await world.pass_until(lambda: world.is_over)
    await world.settle()

    numbers = [state.seq for state in world.states]
    assert numbers == sorted(set(numbers))
    activities = [state.activity for state in world.states]
    assert [one for one in activities if one not in ("IDLE", "WAITING")] == [
        "LOADING",
        "FLYING",
        "FLYING",
        "DELIVERING",
        "RECHARGING",
        "FLYING",
        "DELIVERING",
        "FLYING",
    ]
    flying = next(state for state in world.states if state.activity == "FLYING")
    assert (flying.mission_id, flying.mission_revision) == ("msn_1", 1)
    assert (flying.step_id, flying.released_through, flying.station_id) == (2, 3, None)
    assert world.states[-1].last_event_seq == len(world.events)


async def test_events_are_sent_again_when_the_cloud_asks(world: Any, cloud: Any, trip: Any) -> None:
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: len(world.events) == 4)
    first_time = world.events
    world.published.clear()

    await world.send(cloud.report_request(after_seq=2))
    await world.settle()

    assert world.events == first_time[2:]
    assert [ack.status for ack in world.messages(ACKS)] == ["RECEIVED", "ACCEPTED"]


async def test_confirmed_events_are_dropped(world: Any, cloud: Any, trip: Any) -> None:
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: len(world.events) == 4)
    world.published.clear()

    await world.send(cloud.report_request(after_seq=0, events_confirmed_seq=3))
    await world.settle()

    assert [event.seq for event in world.events] == [4]


async def test_telemetry_comes_at_most_once_a_wall_second_and_only_when_it_moves(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    await world.send(cloud.mission(trip))

    await world.pass_until(lambda: world.is_over)
    await world.pass_time(timedelta(hours=2))

    moments = [sample.sent_at for sample in world.messages(TELEMETRY)]
    gaps = [later - earlier for earlier, later in pairwise(moments)]
    assert 3 <= len(moments) <= 6
    assert min(gaps) >= timedelta(seconds=600)
    assert max(moments) <= trip[-1].planned_end_at


async def test_telemetry_shows_how_the_charge_grows(world: Any, cloud: Any, trip: Any) -> None:
    world.clock.rate = 1.0
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: world.states[-1].activity == "RECHARGING")
    world.published.clear()

    await world.pass_time(timedelta(minutes=2))

    charges = [sample.soc for sample in world.messages(TELEMETRY)]
    assert len(charges) >= 11
    assert charges == sorted(set(charges))


async def test_telemetry_of_a_straight_flight_goes_out_every_ten_seconds(
    world: Any, cloud: Any, steps: Any
) -> None:
    world.clock.rate = 1.0
    straight = steps().fly("home", "over", length_m=9_630, duration_s=512)
    await world.start()
    await world.send(cloud.mission(straight.made))

    await world.pass_until(lambda: world.is_over)

    moments = [sample.sent_at for sample in world.messages(TELEMETRY)]
    gaps = [later - earlier for earlier, later in pairwise(moments)]
    assert max(gaps) == timedelta(seconds=10)
    assert 482 / 10 <= len(moments) <= 482 / 10 + 10


async def test_events_asked_for_while_one_is_sent_are_sent_too(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: len(world.events) == 2)
    world.pubacks.clear()
    await world.pass_until(lambda: len(world.events) == 3)
    world.published.clear()

    await world.send(cloud.report_request(after_seq=0))
    world.pubacks.set()
    await world.settle()

    assert [event.seq for event in world.events][:3] == [1, 2, 3]


async def test_a_state_never_counts_events_that_were_not_sent_before(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    await world.send(cloud.mission(trip))

    await world.pass_until(lambda: world.is_over)
    await world.settle()

    sent = 0
    for topic, message in world.published:
        if topic is EVENTS:
            sent = message.seq
        if topic is STATE:
            assert message.last_event_seq <= sent
    assert world.states[-1].last_event_seq == 9


async def test_a_mission_that_begins_immediately_is_reported_in_one_state(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    await world.pass_time(PRE_START)
    before = len(world.states)

    await world.send(cloud.mission(trip))

    assert [state.activity for state in world.states[before:]] == ["LOADING"]


async def test_a_state_waits_for_the_ack_of_the_instruction_that_it_counts(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    before = len(world.states)
    world.pubacks.clear()

    await world.send(cloud.mission(trip))
    assert [ack.status for ack in world.acks] == ["RECEIVED", "ACCEPTED"]
    assert len(world.states) == before

    world.pubacks.set()
    await world.settle()
    assert world.states[-1].last_instruction_seq == 1
