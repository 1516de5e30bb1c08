"""Flying a mission as planned, and short of what was planned."""

from datetime import timedelta
from typing import Any

from skyway.contracts.message import utc_text

PRE_START = timedelta(minutes=10)


async def test_a_mission_is_flown_by_the_plans_own_arithmetic(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    await world.send(cloud.mission(trip))

    await world.pass_until(lambda: world.is_over)

    flown = [event for event in world.events if event.event == "STEP_ENDED"]
    assert [event.step_id for event in flown] == [step.step_id for step in trip]
    for event, step in zip(flown, trip, strict=True):
        assert abs(event.started_at - step.planned_start_at) < timedelta(milliseconds=1)
        assert abs(event.ended_at - step.planned_end_at) < timedelta(milliseconds=1)


async def test_an_instruction_is_acked_received_then_accepted(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()

    await world.send(cloud.mission(trip, traceparent="00-1-2-01"))

    assert [ack.status for ack in world.acks] == ["RECEIVED", "ACCEPTED"]
    assert {ack.traceparent for ack in world.acks} == {"00-1-2-01"}


async def test_the_journal_is_written_before_each_ack_and_each_act(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    await world.send(cloud.mission(trip))

    await world.pass_until(lambda: world.is_over)

    ignored = ("connection", "state", "telemetry")
    trace = [entry for entry in world.trace if entry.split()[1] not in ignored]
    assert trace[:3] == ["journal INSTRUCTION", "publish acks", "publish acks"]
    assert trace.index("journal STEP") < trace.index("journal EVENT")
    events = [n for n, entry in enumerate(trace) if entry == "journal EVENT"]
    sendings = [n for n, entry in enumerate(trace) if entry == "publish events"]
    assert all(written < sent for written, sent in zip(events, sendings, strict=True))


async def test_a_delivery_is_reported_with_place_and_weights(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    await world.send(cloud.mission(trip))

    await world.pass_until(lambda: len(world.events) >= 4)

    handed_over = world.events[3]
    assert handed_over.package_ids == ("p1",)
    assert handed_over.station_id == "shop"
    assert handed_over.data == {
        "place": {"station_id": "shop", "position": [-97.8, 30.0]},
        "at": utc_text(handed_over.ended_at),
        "mass_kg": {"p1": 0.5},
        "load_before_kg": 1.0,
        "load_after_kg": 0.5,
    }


async def test_a_short_charge_that_is_enough_flies_on(world: Any, cloud: Any, steps: Any) -> None:
    trip = (
        steps()
        .fly("home", "shop", length_m=8000, duration_s=430)
        .recharge("shop", until_soc=1.0, duration_s=100)
        .fly("shop", "home", length_m=8000, duration_s=430)
    )
    await world.start()
    await world.send(cloud.mission(trip.made))

    await world.pass_until(lambda: world.is_over)

    assert [event.code for event in world.events] == [None, "SHORT_CHARGE", None, None]
    assert world.events[1].ended_at == trip.made[1].not_after_at


async def test_a_short_charge_that_is_not_enough_waits_for_a_new_revision(
    world: Any, cloud: Any, steps: Any
) -> None:
    far = (
        steps()
        .fly("home", "shop", length_m=50_000, duration_s=2530)
        .recharge("shop", until_soc=1.0, duration_s=100)
        .fly("shop", "home", length_m=50_000, duration_s=2530)
    )
    await world.start()
    await world.send(cloud.mission(far.made))
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
    await world.send(cloud.mission(charge_first.made, revision=2))
    await world.pass_until(lambda: world.is_over)

    assert [event.event for event in world.events[3:]] == [
        "STEP_ENDED",
        "STEP_ENDED",
        "MISSION_ENDED",
    ]
    assert world.events[3].started_at == charge_first.made[0].planned_start_at


async def test_a_pad_that_is_over_on_arrival_is_lost(world: Any, cloud: Any, steps: Any) -> None:
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
    await world.send(cloud.mission(trip.made))

    await world.pass_until(lambda: len(world.events) == 2)

    assert (world.events[1].event, world.events[1].code) == ("STEP_FAILED", "PAD_LOST")
    assert world.states[-1].activity == "WAITING"
