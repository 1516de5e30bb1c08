"""A whole agent with a fake broker, a fake cloud and a virtual clock."""

from datetime import timedelta
from itertools import pairwise
from typing import Any

import pytest

from skyway.contracts.topics import ACKS, CONNECTION, STATE, TELEMETRY

PRE_START = timedelta(minutes=10)


async def test_a_mission_is_flown_by_the_plans_own_arithmetic(world: Any, trip: Any) -> None:
    await world.start()
    await world.send(world.mission(trip))

    await world.pass_until(lambda: world.is_over)

    flown = [event for event in world.events if event.event == "STEP_ENDED"]
    assert [event.step_id for event in flown] == [step.step_id for step in trip]
    for event, step in zip(flown, trip, strict=True):
        assert abs(event.started_at - step.planned_start_at) < timedelta(milliseconds=1)
        assert abs(event.ended_at - step.planned_end_at) < timedelta(milliseconds=1)


async def test_an_instruction_is_acked_received_then_accepted(world: Any, trip: Any) -> None:
    await world.start()

    await world.send(world.mission(trip, traceparent="00-1-2-01"))

    assert [ack.status for ack in world.acks] == ["RECEIVED", "ACCEPTED"]
    assert {ack.traceparent for ack in world.acks} == {"00-1-2-01"}


async def test_the_journal_is_written_before_each_ack_and_each_act(world: Any, trip: Any) -> None:
    await world.start()
    await world.send(world.mission(trip))

    await world.pass_until(lambda: world.is_over)

    ignored = ("connection", "state", "telemetry")
    trace = [entry for entry in world.trace if entry.split()[1] not in ignored]
    assert trace[:3] == ["journal INSTRUCTION", "publish acks", "publish acks"]
    assert trace.index("journal STEP") < trace.index("journal EVENT")
    events = [n for n, entry in enumerate(trace) if entry == "journal EVENT"]
    sendings = [n for n, entry in enumerate(trace) if entry == "publish events"]
    assert all(written < sent for written, sent in zip(events, sendings, strict=True))


@pytest.mark.parametrize("when", ["dies_before", "dies_after"])
@pytest.mark.parametrize("write", range(1, 19))
async def test_after_a_crash_at_any_write_each_step_happens_exactly_once(
    world: Any, trip: Any, write: int, when: str
) -> None:
    setattr(world.journal, when, write)
    mission = world.mission(trip)
    await world.start()
    await world.send(mission)
    await world.pass_until(lambda: world.has_died or world.is_over)
    assert world.has_died

    await world.kill()
    setattr(world.journal, when, None)
    await world.start()
    await world.send(mission)
    await world.pass_until(lambda: world.is_over)

    assert [event.seq for event in world.events] == list(range(1, len(trip) + 2))
    assert [event.step_id for event in world.events] == [*(step.step_id for step in trip), None]
    assert {event.event for event in world.events[:-1]} == {"STEP_ENDED"}
    assert world.states[-1].package_ids == ()


async def test_no_nineteenth_write_is_left_to_crash_at(world: Any, trip: Any) -> None:
    await world.start()
    await world.send(world.mission(trip))

    await world.pass_until(lambda: world.is_over)

    assert world.journal.writes == 18


async def test_a_flight_goes_on_from_its_own_start_after_a_crash(world: Any, trip: Any) -> None:
    await world.start()
    await world.send(world.mission(trip))
    await world.pass_until(lambda: any(state.activity == "FLYING" for state in world.states))

    await world.kill()
    await world.pass_time(timedelta(seconds=100))
    await world.start()
    await world.pass_until(lambda: len(world.events) == 2)

    flown = world.events[1]
    assert abs(flown.started_at - trip[1].planned_start_at) < timedelta(milliseconds=1)
    assert abs(flown.ended_at - trip[1].planned_end_at) < timedelta(milliseconds=1)


async def test_no_step_begins_while_no_agent_runs(world: Any, trip: Any) -> None:
    await world.start()
    await world.send(world.mission(trip))
    await world.pass_until(lambda: len(world.events) == 3)

    await world.kill()
    await world.pass_time(timedelta(hours=1))
    await world.start()
    back_at = world.clock.now()
    await world.pass_until(lambda: world.events[-1].event == "STEP_FAILED")

    assert world.events[-1].code == "PAD_LOST"
    assert world.events[-1].ended_at == back_at


async def test_a_repeated_instruction_is_acked_again_and_done_once(world: Any, trip: Any) -> None:
    mission = world.mission(trip)
    await world.start()
    await world.send(mission)
    await world.pass_until(lambda: len(world.events) == 1)

    await world.send(mission)
    await world.pass_until(lambda: world.is_over)

    assert [ack.status for ack in world.acks] == ["RECEIVED", "ACCEPTED", "ACCEPTED"]
    assert [event.step_kind for event in world.events].count("PICK_UP") == 1


async def test_loading_waits_for_the_link(world: Any, trip: Any) -> None:
    await world.start()
    await world.send(world.mission(trip))
    world.link.cut()

    await world.pass_time(PRE_START + timedelta(minutes=30))
    assert world.events == []
    back_at = world.clock.now()
    world.link.connect()
    await world.pass_until(lambda: len(world.events) == 1)

    assert world.events[0].started_at == back_at


async def test_loading_waits_for_the_brokers_word_on_the_acceptance(world: Any, trip: Any) -> None:
    await world.start()
    world.pubacks.clear()
    await world.send(world.mission(trip))

    await world.pass_time(PRE_START + timedelta(minutes=30))
    assert all(state.activity == "IDLE" for state in world.states)
    confirmed_at = world.clock.now()
    world.pubacks.set()
    await world.pass_until(lambda: len(world.events) == 1)

    assert world.events[0].started_at == confirmed_at


async def test_a_drone_that_lost_the_link_lands_and_waits_there(world: Any, trip: Any) -> None:
    world.clock.rate = 10.0
    await world.start()
    await world.send(world.mission(trip))
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


async def test_a_link_that_blinks_delays_nothing(world: Any, trip: Any) -> None:
    await world.start()
    await world.send(world.mission(trip))
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

    told = [(one.connection_number, one.status) for one in world.messages(CONNECTION)]
    assert list(dict.fromkeys(told)) == [(1, "ONLINE"), (1, "LOST"), (2, "ONLINE"), (3, "OFFLINE")]
    assert len({one.session for one in world.messages(CONNECTION)}) == 1


async def test_each_start_has_a_later_session(world: Any) -> None:
    await world.start()
    await world.kill()
    await world.start()

    sessions = [one.session for one in world.messages(CONNECTION) if one.status == "ONLINE"]
    assert sessions[0] < sessions[-1]


async def test_the_state_is_told_again_on_every_connection(world: Any) -> None:
    await world.start()
    before = len(world.states)

    world.link.cut()
    world.link.connect()
    await world.pass_time(timedelta(seconds=600))

    assert len(world.states) == before + 1
    assert (world.states[-1].stream, world.states[-1].last_instruction_seq) == (0, 0)


async def test_the_state_is_told_every_30_s_of_wall_time(world: Any) -> None:
    await world.start()
    before = len(world.states)

    await world.pass_time(timedelta(seconds=600 * 95))

    assert len(world.states) == before + 3


async def test_states_are_numbered_upwards_and_name_the_mission(world: Any, trip: Any) -> None:
    await world.start()
    await world.send(world.mission(trip))

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


async def test_events_are_sent_again_when_the_cloud_asks(world: Any, trip: Any) -> None:
    await world.start()
    await world.send(world.mission(trip))
    await world.pass_until(lambda: len(world.events) == 4)
    first_time = world.events
    world.published.clear()

    await world.send(world.report_request(after_seq=2))
    await world.settle()

    assert world.events == first_time[2:]
    assert [ack.status for ack in world.messages(ACKS)] == ["RECEIVED", "ACCEPTED"]


async def test_confirmed_events_are_forgotten(world: Any, trip: Any) -> None:
    await world.start()
    await world.send(world.mission(trip))
    await world.pass_until(lambda: len(world.events) == 4)
    world.published.clear()

    await world.send(world.report_request(after_seq=0, events_confirmed_seq=3))
    await world.settle()

    assert [event.seq for event in world.events] == [4]


async def test_events_that_happened_without_a_link_are_sent_when_it_is_back(
    world: Any, trip: Any
) -> None:
    await world.start()
    await world.send(world.mission(trip))
    await world.pass_until(lambda: any(state.activity == "FLYING" for state in world.states))

    world.link.cut()
    await world.pass_time(timedelta(hours=1))
    world.link.connect()
    await world.pass_until(lambda: world.is_over)

    assert [event.seq for event in world.events] == list(range(1, 10))


async def test_a_delivery_is_told_with_place_and_weights(world: Any, trip: Any) -> None:
    await world.start()
    await world.send(world.mission(trip))

    await world.pass_until(lambda: len(world.events) >= 4)

    handed_over = world.events[3]
    assert handed_over.package_ids == ("p1",)
    assert handed_over.station_id == "shop"
    assert handed_over.data == {
        "mass_kg": {"p1": 0.5},
        "load_before_kg": 1.0,
        "load_after_kg": 0.5,
    }


async def test_telemetry_comes_at_most_once_a_wall_second_and_only_when_it_moves(
    world: Any, trip: Any
) -> None:
    await world.start()
    await world.send(world.mission(trip))

    await world.pass_until(lambda: world.is_over)
    await world.pass_time(timedelta(hours=2))

    moments = [sample.at for sample in world.messages(TELEMETRY)]
    gaps = [later - earlier for earlier, later in pairwise(moments)]
    assert 3 <= len(moments) <= 6
    assert min(gaps) >= timedelta(seconds=600)
    assert max(moments) <= trip[-1].planned_end_at


async def test_a_short_charge_that_is_enough_flies_on(world: Any, steps: Any) -> None:
    trip = (
        steps()
        .fly("home", "shop", length_m=8000, duration_s=430)
        .recharge("shop", until_soc=1.0, duration_s=100)
        .fly("shop", "home", length_m=8000, duration_s=430)
    )
    await world.start()
    await world.send(world.mission(trip.made))

    await world.pass_until(lambda: world.is_over)

    assert [event.code for event in world.events] == [None, "SHORT_CHARGE", None, None]
    assert world.events[1].ended_at == trip.made[1].not_after_at


async def test_a_short_charge_that_is_not_enough_waits_for_a_new_revision(
    world: Any, steps: Any
) -> None:
    far = (
        steps()
        .fly("home", "shop", length_m=50_000, duration_s=2530)
        .recharge("shop", until_soc=1.0, duration_s=100)
        .fly("shop", "home", length_m=50_000, duration_s=2530)
    )
    await world.start()
    await world.send(world.mission(far.made))
    await world.pass_until(lambda: len(world.events) == 3)

    short, failed = world.events[1:]
    assert (short.event, short.code) == ("STEP_ENDED", "SHORT_CHARGE")
    assert (failed.event, failed.code, failed.step_id) == ("STEP_FAILED", "INSUFFICIENT_ENERGY", 3)
    assert failed.data["need_j"] > failed.data["have_j"]
    assert failed.station_id == "shop"

    charge_first = (
        steps(at=world.clock.now() + timedelta(minutes=5), first_step=3)
        .recharge("shop", until_soc=0.9, duration_s=6000)
        .fly("shop", "home", length_m=50_000, duration_s=2530)
    )
    await world.send(world.mission(charge_first.made, revision=2))
    await world.pass_until(lambda: world.is_over)

    assert [event.event for event in world.events[3:]] == [
        "STEP_ENDED",
        "STEP_ENDED",
        "MISSION_ENDED",
    ]
    assert world.events[3].started_at == charge_first.made[0].planned_start_at


async def test_a_pad_that_is_over_on_arrival_is_lost(world: Any, steps: Any) -> None:
    trip = (
        steps()
        .fly("home", "shop", length_m=8000, duration_s=430)
        .recharge("shop", until_soc=1.0, duration_s=900)
        .fly("shop", "home", length_m=8000, duration_s=430)
    )
    trip.made[1] = trip.made[1].model_copy(
        update={"not_after_at": trip.made[0].planned_start_at + timedelta(seconds=300)}
    )
    trip.made[1] = trip.made[1].model_copy(update={"not_before_at": trip.made[0].planned_start_at})
    await world.start()
    await world.send(world.mission(trip.made))

    await world.pass_until(lambda: len(world.events) == 2)

    assert (world.events[1].event, world.events[1].code) == ("STEP_FAILED", "PAD_LOST")
    assert world.states[-1].activity == "WAITING"


async def test_a_revision_replaces_what_is_not_released(world: Any, trip: Any, steps: Any) -> None:
    await world.start()
    await world.send(world.mission(trip))
    await world.pass_until(lambda: any(state.activity == "FLYING" for state in world.states))

    home_from_shop = (
        steps(at=trip[3].planned_end_at, first_step=5)
        .fly("shop", "home", length_m=8000, duration_s=487)
        .bring_back("home", "p2")
    )
    await world.send(world.mission(home_from_shop.made, revision=2))
    await world.pass_until(lambda: world.is_over)

    kinds = [event.step_kind for event in world.events]
    assert kinds == ["PICK_UP", "FLY", "FLY", "DELIVER", "FLY", "RETURN", None]
    assert world.events[-1].mission_revision == 2
    assert world.states[-1].station_id == "home"


async def test_a_revision_of_a_released_step_is_refused_and_the_flight_goes_on(
    world: Any, trip: Any, steps: Any
) -> None:
    await world.start()
    await world.send(world.mission(trip))
    await world.pass_until(lambda: any(state.activity == "FLYING" for state in world.states))

    too_late = steps(first_step=3).fly("over", "farm", length_m=4000, duration_s=300)
    await world.send(world.mission(too_late.made, revision=2))
    await world.pass_until(lambda: world.is_over)

    assert (world.acks[-1].status, world.acks[-1].code) == ("REJECTED", "STEP_RELEASED")
    assert [event.step_id for event in world.events] == [*range(1, 9), None]


async def test_a_state_that_was_not_confirmed_is_sent_as_it_is_then(world: Any, trip: Any) -> None:
    await world.start()
    await world.send(world.mission(trip))
    world.link.cut()
    await world.pass_time(timedelta(hours=1))
    before = len(world.states)

    world.link.connect()
    await world.pass_time(timedelta(seconds=300))

    assert len(world.states) > before
    assert world.states[before].at >= world.clock.now() - timedelta(seconds=300)
    assert STATE.retained
