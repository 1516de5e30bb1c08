"""Steps of a real drone but its flights: recharges, landings on the spot, readings."""

import asyncio
from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.vehicle import Standing, StepRun

from skyway.geo import Position


@pytest.fixture
def drone_itself(world: Any, vehicle: Any) -> Any:
    """The vehicle as an agent has it."""
    return world.vehicle_type()


def run_of(step: Any, world: Any, *, soc: float = 1.0) -> StepRun:
    here = Position(-98.0, 30.0)
    return StepRun(step, world.clock.now(), soc=soc, load_kg=0.0, position=here)


async def test_a_recharge_ends_when_the_autopilot_says_so(
    world: Any, drone_itself: Any, peer: Any, steps: Any, until: Any
) -> None:
    peer.soc = 0.4
    await until(lambda: drone_itself.read(standing(), world.clock.now()).consumed_j > 200_000)
    at = world.clock.now()
    (step,) = steps(at).recharge("home", until_soc=0.8, duration_s=360_000).made
    charging = asyncio.create_task(drone_itself.perform(run_of(step, world, soc=0.4)))
    await asyncio.sleep(0)
    assert not charging.done()

    peer.soc = 0.8
    await until(charging.done)
    outcome = await charging

    assert (outcome.soc, outcome.code) == (0.8, None)


async def test_a_recharge_that_is_cut_by_its_reservation_is_short(
    world: Any, drone_itself: Any, peer: Any, steps: Any, until: Any
) -> None:
    peer.soc = 0.4
    at = world.clock.now()
    (step,) = steps(at).recharge("home", until_soc=0.8, duration_s=300).made
    wait = run_of(steps(at).wait("home", duration_s=120).made[0], world)
    await until(asyncio.create_task(drone_itself.perform(wait)).done)

    charging = asyncio.create_task(drone_itself.perform(run_of(step, world, soc=0.4)))
    await until(charging.done)
    outcome = await charging

    assert (outcome.soc, outcome.code) == (0.4, "SHORT_CHARGE")
    assert outcome.ended_at - step.not_after_at < timedelta(seconds=300)


async def test_a_drone_lands_on_the_spot_on_request(
    world: Any, drone_itself: Any, peer: Any, steps: Any, until: Any
) -> None:
    (step,) = steps(world.clock.now()).fly("home", "shop", length_m=6000, duration_s=400).made
    run = run_of(step, world)
    flying = asyncio.create_task(drone_itself.perform(run))
    await until(lambda: peer.is_in_air and peer.position != Position(-98.0, 30.0))
    flying.cancel()

    landing = asyncio.create_task(drone_itself.land(run))
    await until(landing.done)
    outcome = await landing

    assert not peer.is_in_air
    assert outcome.elsewhere.position == pytest.approx(peer.position, abs=1e-3)
    assert outcome.soc == pytest.approx(peer.soc, abs=0.01)


async def test_a_reading_shows_what_the_autopilot_said(
    world: Any, drone_itself: Any, peer: Any, until: Any
) -> None:
    peer.soc = 0.5
    mav = peer.connection.mav
    north, east, heading_deg = 1200, -500, 90
    mav.global_position_int_send(0, 301_000_000, -979_000_000, 0, 0, north, east, 0, 0)
    mav.vfr_hud_send(9.0, 13.0, heading_deg, 50, 0.0, 0.0)
    mav.sys_status_send(0, 32768, 0, 0, 65535, -1, -1, 0, 0, 0, 0, 0, 0)
    await until(lambda: not drone_itself.read(standing(), world.clock.now()).motors_work)

    reading = drone_itself.read(standing(), world.clock.now())

    assert reading.air_mps == (pytest.approx(9.0), pytest.approx(0.0, abs=1e-9))
    assert reading.voltage_v == pytest.approx(6 * reading.cell_low_v)
    assert reading.temperature_c == 25.0
    assert reading.has_gps


async def test_without_a_fix_there_is_no_gps(
    world: Any, drone_itself: Any, peer: Any, until: Any
) -> None:
    peer.not_sent.update(GPS_RAW_INT=100_000)
    peer.connection.mav.gps_raw_int_send(0, 1, 0, 0, 0, 0, 0, 0, 0, 0)

    await until(lambda: not drone_itself.read(standing(), world.clock.now()).has_gps)


async def test_an_autopilot_that_falls_silent_is_asked_again(
    world: Any, drone_itself: Any, peer: Any, until: Any
) -> None:
    peer.not_sent.update(BATTERY_STATUS=100_000)
    asked = peer.asked[147]

    await until(lambda: not drone_itself.read(standing(), world.clock.now()).has_battery)
    await until(lambda: peer.asked[147] > asked)

    peer.not_sent.clear()
    await until(lambda: drone_itself.read(standing(), world.clock.now()).has_battery)


def standing() -> Standing:
    return Standing(Position(-98.0, 30.0), soc=1.0, load_kg=0.0)
