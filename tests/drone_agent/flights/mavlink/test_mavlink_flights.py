"""A real autopilot's flights: the real agent on one end of a socket, a mission protocol on both."""

from typing import Any

import pytest

from skyway.contracts.flight_step import FlightStep

TAKEOFF, SPEED, WAYPOINT, LAND = 22, 178, 16, 21


@pytest.fixture
def errand(steps: Any) -> list[FlightStep]:
    """Over one station to the shop, a hand-over there, and on to the farm."""
    made = (
        steps()
        .pick_up("home", p1=0.5, p2=0.5)
        .fly("home", "over", length_m=6000, duration_s=400, lands=False)
        .fly("over", "shop", length_m=6000, duration_s=430)
        .deliver("shop", "p1")
        .fly("shop", "farm", length_m=7000, duration_s=430)
        .deliver("farm", "p2")
    )
    return list(made.made)


@pytest.fixture
async def flown(world: Any, vehicle: Any, cloud: Any, errand: Any) -> Any:
    """The world once its agent has accepted the errand."""
    await world.start()
    await world.send(cloud.mission(errand))
    return world


async def test_a_mission_of_two_flights_is_flown_with_its_hand_overs(
    flown: Any, peer: Any, until: Any
) -> None:
    await until(lambda: flown.is_over)

    reported = [(event.event, event.step_kind, event.station_id) for event in flown.events]
    assert reported == [
        ("STEP_ENDED", "PICK_UP", "home"),
        ("STEP_ENDED", "FLY", "over"),
        ("STEP_ENDED", "FLY", "shop"),
        ("STEP_ENDED", "DELIVER", "shop"),
        ("STEP_ENDED", "FLY", "farm"),
        ("STEP_ENDED", "DELIVER", "farm"),
        ("MISSION_ENDED", None, "farm"),
    ]
    assert peer.released == 2
    assert flown.events[-1].soc == pytest.approx(0.88, abs=0.02)


async def test_released_flights_are_uploaded_up_to_their_landing(
    flown: Any, peer: Any, until: Any
) -> None:
    await until(lambda: flown.is_over)

    first, second = peer.missions
    home = [WAYPOINT] if peer.modes else []
    assert [item.command for item in first] == [*home, TAKEOFF, SPEED, WAYPOINT, WAYPOINT, LAND]
    assert [item.command for item in second] == [*home, TAKEOFF, SPEED, WAYPOINT, LAND]
    shop = first[-1]
    assert (shop.x, shop.y) == (300_000_000, -978_000_000)
    speed = first[len(home) + 1]
    assert (speed.param1, speed.param2) == (1.0, 15.0)


async def test_messages_lost_and_repeated_change_nothing(
    world: Any, vehicle: Any, peer: Any, cloud: Any, errand: Any, until: Any
) -> None:
    peer.lost_messages.update(MISSION_COUNT=1, MISSION_ITEM_INT=1)
    peer.not_sent.update(COMMAND_ACK=1, MISSION_ITEM_REACHED=3)
    peer.sent_twice = {"MISSION_REQUEST_INT", "MISSION_ACK", "COMMAND_ACK", "MISSION_ITEM_REACHED"}
    await world.start()
    await world.send(cloud.mission(errand))

    await until(lambda: world.is_over)

    assert [event.event for event in world.events][:-1] == ["STEP_ENDED"] * 6
    assert len(peer.missions) == 2
    assert peer.released == 2


async def test_a_mission_that_the_autopilot_refuses_fails_where_the_drone_stands(
    world: Any, vehicle: Any, peer: Any, cloud: Any, errand: Any, until: Any
) -> None:
    peer.refused_item = 2
    await world.start()
    await world.send(cloud.mission(errand))

    await until(lambda: len(world.events) == 2)

    failed = world.events[-1]
    assert (failed.event, failed.code) == ("STEP_FAILED", "AUTOPILOT_REFUSED")
    assert (failed.step_id, failed.station_id) == (2, "home")
    assert not peer.is_armed


async def test_an_autopilot_that_does_not_arm_fails_the_step(
    world: Any, vehicle: Any, peer: Any, cloud: Any, errand: Any, until: Any
) -> None:
    peer.answers[400] = 4  # MAV_RESULT_FAILED
    await world.start()
    await world.send(cloud.mission(errand))

    await until(lambda: len(world.events) == 2)

    assert (world.events[-1].code, world.events[-1].station_id) == ("AUTOPILOT_REFUSED", "home")


async def test_an_unconfirmed_release_is_unknown_and_never_repeated(
    flown: Any, peer: Any, until: Any
) -> None:
    peer.unanswered.add(211)

    await until(lambda: len(flown.events) == 4)

    failed = flown.events[-1]
    assert (failed.event, failed.code) == ("STEP_FAILED", "UNKNOWN")
    assert failed.package_ids == ()
    assert peer.released == 1


async def test_a_release_that_is_refused_fails_the_step(flown: Any, peer: Any, until: Any) -> None:
    peer.answers[211] = 2  # MAV_RESULT_DENIED

    await until(lambda: len(flown.events) == 4)

    failed = flown.events[-1]
    assert (failed.event, failed.code) == ("STEP_FAILED", "HAND_OVER_REFUSED")
    assert (failed.station_id, peer.released) == ("shop", 0)


async def test_an_agent_killed_in_flight_continues_the_flight(
    flown: Any, peer: Any, until: Any
) -> None:
    await until(lambda: len(flown.events) == 1 and peer.is_in_air)
    await flown.kill()
    await flown.start()

    await until(lambda: flown.is_over)

    assert [event.event for event in flown.events] == ["STEP_ENDED"] * 6 + ["MISSION_ENDED"]
    assert peer.released == 2


async def test_an_agent_killed_in_a_hand_over_never_repeats_the_release(
    flown: Any, peer: Any, vehicle: Any, until: Any
) -> None:
    peer.unanswered.add(211)  # killed before the answer arrives
    await until(lambda: peer.released == 1)
    await flown.kill()
    await vehicle()
    await flown.start()

    await until(lambda: len(flown.events) == 4)

    assert (flown.events[-1].step_kind, flown.events[-1].code) == ("DELIVER", "UNKNOWN")
    assert peer.released == 1


async def test_a_drone_brought_down_elsewhere_says_where(flown: Any, peer: Any, until: Any) -> None:
    peer.lands_at = peer.position

    await until(lambda: len(flown.events) == 3)

    failed = flown.events[-1]
    assert (failed.event, failed.code) == ("STEP_FAILED", "LANDED_ELSEWHERE")
    assert failed.station_id is None
    assert failed.position == pytest.approx(peer.position, abs=1e-6)
