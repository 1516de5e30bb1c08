"""A full disk: no step begins, no instruction is accepted, and a flying drone lands."""

from datetime import timedelta
from typing import Any

from skyway_drone_agent.simulated.disturbances import Disturbances

from skyway.contracts.topics import EVENTS


def is_flying(world: Any) -> bool:
    return bool(world.states) and world.states[-1].activity == "FLYING"


async def test_an_instruction_that_cannot_be_journaled_gets_no_ack_until_there_is_room(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    world.journal.is_full = True
    mission = cloud.mission(trip)
    await world.send(mission)
    await world.pass_time(timedelta(hours=6))
    assert world.acks == []
    assert "DISK_FULL" in world.states[-1].faults

    world.journal.is_full = False
    await world.pass_time(timedelta(hours=6))
    await world.send(cloud.mission(trip, seq=1))

    assert [ack.status for ack in world.acks] == ["RECEIVED", "ACCEPTED"]
    reported = [event for event in world.events if event.event == "ALARM"]
    assert [(one.code, one.level) for one in reported] == [("DISK_FULL", "CRITICAL")]
    assert world.states[-1].faults == ()


async def fill_up_in_the_air(world: Any, cloud: Any, trip: Any) -> None:
    """In the air towards the station that is flown over, with no room on the disk."""
    world.clock.rate = 40.0
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: is_flying(world))
    world.journal.is_full = True


async def test_a_drone_in_the_air_flies_over_its_station_lands_and_begins_nothing(
    world: Any, cloud: Any, trip: Any
) -> None:
    await fill_up_in_the_air(world, cloud, trip)

    await world.pass_time(timedelta(hours=1))

    state = world.states[-1]
    assert (state.activity, state.station_id, state.step_id) == ("WAITING", "shop", 4)
    assert [event.step_id for event in world.events] == [1]
    # An event that is not written is never sent, so the state does not announce it.
    assert state.last_event_seq == 1
    assert state.failsafe.failsafe == "STAY"


async def test_events_on_a_full_disk_are_written_and_sent_once_there_is_room(
    world: Any, cloud: Any, steps: Any
) -> None:
    trip = steps().fly("home", "over", length_m=6000, duration_s=400, lands=False)
    trip.fly("over", "shop", length_m=6000, duration_s=430).wait("shop", duration_s=60)
    trip.fly("shop", "home", length_m=9000, duration_s=500)
    await fill_up_in_the_air(world, cloud, trip.made)
    await world.pass_time(timedelta(hours=1))
    room_at = world.clock.now()

    world.journal.is_full = False
    await world.pass_until(lambda: world.is_over)

    ends = [event for event in world.events if event.event != "ALARM"]
    assert [event.step_id for event in ends] == [1, 2, 3, 4, None]
    assert [event.seq for event in world.events] == list(range(1, len(world.events) + 1))
    assert ends[1].ended_at < room_at < ends[2].started_at < room_at + timedelta(minutes=2)
    logbook = world.journal.read(at_first=world.drone.at_first())
    assert (logbook.mission, logbook.last_event_seq) == (None, len(world.events))


async def test_an_unwritten_event_number_is_never_reported(
    world: Any, cloud: Any, steps: Any
) -> None:
    trip = steps().fly("home", "over", length_m=6000, duration_s=400, lands=False)
    trip.fly("over", "shop", length_m=6000, duration_s=430)
    await fill_up_in_the_air(world, cloud, trip.made)
    await world.pass_time(timedelta(seconds=600))
    await world.kill()
    await world.start()
    await world.pass_time(timedelta(seconds=600))

    world.journal.is_full = False
    await world.pass_until(lambda: world.is_over)

    meanings: dict[int, set[Any]] = {}
    for event in world.messages(EVENTS):
        meanings.setdefault(event.seq, set()).add((event.event, event.step_id, event.code))
    assert all(len(known) == 1 for known in meanings.values())
    ends = [event.step_id for event in world.events if event.event != "ALARM"]
    assert ends == [1, 2, None]


async def test_a_failsafe_acts_without_a_journal_too(world: Any, cloud: Any, steps: Any) -> None:
    world.disturbances = Disturbances(flight_energy_factor=1.4)
    trip = steps().pick_up("home", p1=1.0)
    trip.fly("home", "farm", length_m=28_900, duration_s=2000).deliver("farm", "p1")
    await fill_up_in_the_air(world, cloud, trip.made)

    await world.pass_until(lambda: world.states[-1].activity == "WAITING")
    assert world.states[-1].station_id == "home"
    world.journal.is_full = False
    await world.pass_until(lambda: bool(world.events) and world.events[-1].event == "STEP_FAILED")

    assert (world.events[-1].code, world.events[-1].station_id) == ("BATTERY_SHORT", "home")


async def test_a_drone_whose_session_cannot_be_written_lands_in_silence_until_there_is_room(
    world: Any, cloud: Any, trip: Any
) -> None:
    await fill_up_in_the_air(world, cloud, trip)
    await world.kill()
    reported = len(world.published)
    await world.start()

    await world.pass_time(timedelta(hours=1))
    assert len(world.published) == reported
    world.journal.is_full = False
    await world.pass_time(timedelta(seconds=5 * world.clock.rate))

    assert world.states[-1].station_id == "shop"
    ended = [event.step_id for event in world.events if event.event == "STEP_ENDED"]
    assert ended == [1, 2, 3, 4]


async def test_no_two_starts_on_a_full_disk_speak_under_the_same_session(
    world: Any, cloud: Any, trip: Any
) -> None:
    await fill_up_in_the_air(world, cloud, trip)
    # The clock stands, as if it was set back: both starts have the same time.
    for _ in range(2):
        await world.kill()
        await world.start()
        await world.settle()
    world.journal.is_full = False
    await world.kill()
    await world.start()
    await world.pass_until(lambda: world.is_over)

    numbers = [(one.session, one.seq) for one in world.states]
    assert len(set(numbers)) == len(numbers)
    assert len({session for session, _ in numbers}) == 2
