"""New steps for a drone that flies, or that stands in the middle of a step."""

from datetime import timedelta
from typing import Any

import pytest

from skyway.contracts.message import utc_text

A_MOMENT = timedelta(milliseconds=1)


def codes(world: Any) -> list[tuple[int, int, str | None]]:
    """Each step's end: revision, step, code."""
    return [
        (event.mission_revision, event.step_id, event.code)
        for event in world.events
        if event.event != "MISSION_ENDED"
    ]


async def fly(world: Any, cloud: Any, steps: Any) -> None:
    """In the air towards the station that is flown over, with p1 on board."""
    trip = (
        steps()
        .pick_up("home", p1=1.0)
        .fly("home", "over", length_m=6000, duration_s=400, lands=False)
        .fly("over", "shop", length_m=6000, duration_s=430)
        .deliver("shop", "p1")
        .fly("shop", "home", length_m=8000, duration_s=430)
    )
    await world.start()
    await world.send(cloud.mission(trip.made))
    await world.pass_until(lambda: any(state.activity == "FLYING" for state in world.states))


async def test_a_drone_in_the_air_lands_where_it_was_to_fly_over(
    world: Any, cloud: Any, steps: Any
) -> None:
    await fly(world, cloud, steps)

    there = steps(at=world.clock.now(), first_step=3).wait("over", duration_s=600)
    back = there.fly("over", "home", length_m=6000, duration_s=430).bring_back("home", "p1")
    await world.send(cloud.divert(back.made))
    assert world.states[-1].released_through == 2
    await world.pass_until(lambda: world.is_over)

    assert (world.acks[-1].status, world.acks[-1].code) == ("ACCEPTED", None)
    assert codes(world) == [(1, 1, None), (2, 2, None), (2, 3, None), (2, 4, None), (2, 5, None)]
    landed = world.events[1]
    assert landed.ended_at - landed.started_at == timedelta(seconds=430)
    assert world.states[-1].package_ids == ()


async def test_a_drone_in_the_air_flies_over_the_landing_that_is_closed(
    world: Any, cloud: Any, steps: Any
) -> None:
    await fly(world, cloud, steps)

    farm = steps(at=world.clock.now(), first_step=4).fly(
        "shop", "farm", length_m=3000, duration_s=230
    )
    await world.send(cloud.divert(farm.deliver("farm", "p1").made))
    assert world.states[-1].released_through == 4
    await world.pass_until(lambda: world.is_over)

    over, passed, landed = world.events[1:4]
    assert over.ended_at - over.started_at == timedelta(seconds=400)
    assert passed.ended_at - passed.started_at == timedelta(seconds=400)
    assert (landed.started_at, landed.station_id) == (passed.ended_at, "farm")
    assert world.states[-1].station_id == "farm"


async def test_a_landing_drone_flies_on_at_the_earliest_when_it_got_the_instruction(
    world: Any, cloud: Any, steps: Any
) -> None:
    await fly(world, cloud, steps)
    await world.pass_until(lambda: world.events[-1].step_id == 2)
    over_shop_at = world.events[-1].ended_at + timedelta(seconds=400)
    await world.pass_time(over_shop_at + timedelta(seconds=15) - world.clock.now())
    acceptance_sent_at = world.clock.now()

    farm = steps(at=acceptance_sent_at, first_step=4).fly(
        "shop", "farm", length_m=3000, duration_s=230
    )
    await world.send(cloud.divert(farm.deliver("farm", "p1").made))
    await world.pass_until(lambda: world.is_over)

    passed = world.events[2]
    assert passed.ended_at == acceptance_sent_at
    assert passed.energy_j == pytest.approx(400 * 100 * 1.25**1.5 + 15 / 30 * 1000)


@pytest.mark.parametrize("seconds", [50, 430])
async def test_an_ended_step_is_not_replaced(
    world: Any, cloud: Any, steps: Any, seconds: int
) -> None:
    await fly(world, cloud, steps)
    await world.pass_time(timedelta(seconds=seconds))

    elsewhere = steps(at=world.clock.now(), first_step=2)
    elsewhere.fly("home", "farm", length_m=4000, duration_s=300)
    await world.send(cloud.divert(elsewhere.made))

    assert world.acks[-1].code == "STEP_RELEASED"
    assert world.acks[-1].data == {"released_through": 3, "step_id": 2 if seconds == 50 else 3}


async def charge(world: Any, cloud: Any, steps: Any) -> Any:
    """On the pad for half an hour, after a flight; the flight home has no energy otherwise."""
    trip = (
        steps()
        .fly("home", "shop", length_m=50_000, duration_s=2530)
        .recharge("shop", until_soc=0.9, duration_s=7200)
        .fly("shop", "home", length_m=50_000, duration_s=2530)
    )
    await world.start()
    await world.send(cloud.mission(trip.made))
    await world.pass_until(lambda: world.states[-1].activity == "RECHARGING")
    await world.pass_time(timedelta(seconds=1800))
    return trip


async def test_a_recharge_that_is_cut_has_charged_so_far(
    world: Any, cloud: Any, steps: Any
) -> None:
    await charge(world, cloud, steps)
    arrived, cut_at = world.events[0], world.clock.now()
    charged_s = (cut_at - arrived.ended_at).total_seconds()

    nearer = steps(at=cut_at, first_step=2).fly("shop", "farm", length_m=20_000, duration_s=1030)
    await world.send(cloud.divert(nearer.made))
    await world.pass_until(lambda: world.is_over)

    assert codes(world) == [(1, 1, None), (1, 2, "CUT"), (2, 2, None)]
    cut = world.events[1]
    assert (cut.step_kind, cut.started_at, cut.ended_at) == ("RECHARGE", arrived.ended_at, cut_at)
    assert cut.soc == pytest.approx(arrived.soc + charged_s * 0.8 / 3600)
    assert cut.energy_j == 0.0
    assert world.events[2].started_at == cut_at


async def test_a_recharge_under_way_can_stay_before_new_steps(
    world: Any, cloud: Any, steps: Any
) -> None:
    await charge(world, cloud, steps)

    nearer = steps(at=world.clock.now(), first_step=3)
    nearer.fly("shop", "farm", length_m=20_000, duration_s=1030)
    await world.send(cloud.divert(nearer.made))
    await world.pass_until(lambda: world.is_over)

    assert codes(world) == [(1, 1, None), (2, 2, None), (2, 3, None)]
    assert world.events[1].soc == 0.9


async def test_new_steps_beyond_what_a_cut_recharge_gave_are_refused(
    world: Any, cloud: Any, steps: Any
) -> None:
    await charge(world, cloud, steps)
    soc = world.events[0].soc + 1800 * 0.8 / 3600

    home = steps(at=world.clock.now(), first_step=2)
    home.fly("shop", "home", length_m=100_000, duration_s=5030)
    await world.send(cloud.divert(home.made))

    assert world.acks[-1].code == "INSUFFICIENT_ENERGY"
    assert world.acks[-1].data["have_j"] == pytest.approx((soc - 0.1) * 360_000, rel=0.01)
    assert world.states[-1].activity == "RECHARGING"


async def test_what_is_being_loaded_stays_when_the_pick_up_is_cut(
    world: Any, cloud: Any, steps: Any
) -> None:
    trip = steps().pick_up("home", p1=1.0).fly("home", "shop", length_m=6000, duration_s=430)
    await world.start()
    await world.send(cloud.mission(trip.deliver("shop", "p1").made))
    await world.pass_until(lambda: world.states[-1].activity == "LOADING")

    other = steps(at=world.clock.now(), first_step=1).pick_up("home", p2=0.5)
    other.fly("home", "farm", length_m=6000, duration_s=430).deliver("farm", "p2")
    await world.send(cloud.divert(other.made))
    await world.pass_until(lambda: world.is_over)

    assert codes(world) == [(1, 1, "CUT"), (2, 1, None), (2, 2, None), (2, 3, None)]
    assert (world.events[0].package_ids, world.events[0].data) == ((), {})
    assert world.events[-2].package_ids == ("p2",)


async def test_a_drone_sent_home_returns_its_packages_with_proof(
    world: Any, cloud: Any, steps: Any
) -> None:
    await fly(world, cloud, steps)

    home = steps(at=world.clock.now(), first_step=3)
    home.fly("over", "home", length_m=6000, duration_s=430).bring_back("home", "p1")
    await world.send(cloud.return_home(home.made))
    await world.pass_until(lambda: world.is_over)

    returned = world.events[-2]
    assert (returned.step_kind, returned.package_ids) == ("RETURN", ("p1",))
    assert returned.data == {
        "place": {"station_id": "home", "position": [-98.0, 30.0]},
        "at": utc_text(returned.ended_at),
        "mass_kg": {"p1": 1.0},
        "load_before_kg": 1.0,
        "load_after_kg": 0.0,
    }


async def test_packages_on_board_at_the_end_of_a_mission_stay_at_its_station(
    world: Any, cloud: Any, steps: Any
) -> None:
    await fly(world, cloud, steps)
    there = steps(at=world.clock.now(), first_step=3).wait("over", duration_s=600)
    await world.send(cloud.divert(there.made))
    await world.pass_until(lambda: world.is_over)
    assert (world.states[-1].station_id, world.states[-1].package_ids) == ("over", ())

    back = steps(at=world.clock.now()).fly("over", "home", length_m=6000, duration_s=330)
    await world.send(cloud.mission(back.made, mission_id="msn_2"))
    await world.pass_until(lambda: world.states[-1].station_id == "home")

    flown = world.events[-2]
    assert flown.ended_at - flown.started_at == timedelta(seconds=330)


async def test_a_divert_of_a_mission_that_is_not_flown_is_refused(
    world: Any, cloud: Any, steps: Any
) -> None:
    await world.start()

    hop = steps().fly("home", "shop", length_m=6000, duration_s=430)
    await world.send(cloud.divert(hop.made))

    assert world.acks[-1].code == "STALE_REVISION"
