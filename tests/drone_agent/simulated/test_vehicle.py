"""Steps end when physics says, and samples lie between their ends."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.simulated.physics import Physics
from skyway_drone_agent.simulated.vehicle import SimulatedVehicle
from skyway_drone_agent.vehicle import StepRun

from skyway.geo import Position


def run_of(step: Any, *, soc: float = 1.0, load_kg: float = 0.0, late_s: float = 0.0) -> StepRun:
    return StepRun(
        step=step,
        started_at=step.planned_start_at + timedelta(seconds=late_s),
        soc=soc,
        load_kg=load_kg,
        position=getattr(step, "from_position", Position(-98.0, 30.0)),
    )


@pytest.mark.parametrize(("load_kg", "speed_mps"), [(0.0, 20.0), (1.0, 15.0), (2.0, 10.0)])
def test_a_loaded_drone_flies_slower(
    drone: Any, steps: Any, load_kg: float, speed_mps: float
) -> None:
    (step,) = steps().fly("home", "shop", length_m=6000, duration_s=1, lands=False).made

    outcome = Physics(drone.model).outcome_of(run_of(step, load_kg=load_kg))

    flown_s = (outcome.ended_at - step.planned_start_at).total_seconds()
    assert flown_s == pytest.approx(6000 / speed_mps)
    power_w = 100 * ((4 + load_kg) / 4) ** 1.5
    assert outcome.energy_j == pytest.approx(power_w * flown_s)
    assert outcome.soc == pytest.approx(1 - power_w * flown_s / 360_000)


def test_a_landing_takes_its_time_and_energy(drone: Any, steps: Any) -> None:
    (over,) = steps().fly("home", "shop", length_m=6000, duration_s=1, lands=False).made
    (lands,) = steps().fly("home", "shop", length_m=6000, duration_s=1).made

    flown = Physics(drone.model).outcome_of(run_of(over))
    landed = Physics(drone.model).outcome_of(run_of(lands))

    assert landed.ended_at - flown.ended_at == timedelta(seconds=30)
    assert landed.energy_j - flown.energy_j == pytest.approx(1000)


def test_a_recharge_ends_at_the_charge_asked_for(drone: Any, steps: Any) -> None:
    (step,) = steps().recharge("shop", until_soc=0.9, duration_s=9000).made

    outcome = Physics(drone.model).outcome_of(run_of(step, soc=0.4))

    assert outcome.soc == 0.9
    assert outcome.code is None
    assert outcome.ended_at - step.planned_start_at == timedelta(seconds=1800 + 1800)


def test_a_recharge_ends_with_its_reservation_and_is_short(drone: Any, steps: Any) -> None:
    (step,) = steps().recharge("shop", until_soc=0.8, duration_s=1800).made

    outcome = Physics(drone.model).outcome_of(run_of(step, soc=0.4, late_s=900))

    assert outcome.ended_at == step.not_after_at
    assert outcome.soc == pytest.approx(0.4 + 900 * 0.8 / 3600)
    assert outcome.code == "SHORT_CHARGE"


def test_a_recharge_that_lacks_only_the_rounding_is_not_short(drone: Any, steps: Any) -> None:
    (step,) = steps().recharge("shop", until_soc=0.8, duration_s=1800).made

    outcome = Physics(drone.model).outcome_of(run_of(step, soc=0.4, late_s=0.0015))

    assert (outcome.soc, outcome.code) == (0.8, None)


def test_the_recharge_of_a_full_drone_ends_immediately(drone: Any, steps: Any) -> None:
    (step,) = steps().recharge("shop", until_soc=0.8, duration_s=1800).made

    outcome = Physics(drone.model).outcome_of(run_of(step, soc=0.9))

    assert (outcome.ended_at, outcome.soc) == (step.planned_start_at, 0.9)


def test_a_wait_ends_at_its_moment_and_not_before_it_began(drone: Any, steps: Any) -> None:
    (step,) = steps().wait("home", duration_s=300).made

    on_time = Physics(drone.model).outcome_of(run_of(step, late_s=100))
    late = Physics(drone.model).outcome_of(run_of(step, late_s=400))

    assert on_time.ended_at == step.until_at
    assert late.ended_at == step.planned_start_at + timedelta(seconds=400)


def test_hand_overs_take_their_planned_time(drone: Any, steps: Any) -> None:
    made = steps().pick_up("home", p1=0.5).deliver("home", "p1").bring_back("home", "p1").made

    lasting_s = [
        (Physics(drone.model).outcome_of(run_of(step, late_s=7)).ended_at - step.planned_start_at)
        / timedelta(seconds=1)
        - 7
        for step in made
    ]

    assert lasting_s == [60.0, 30.0, 45.0]


def test_halfway_a_drone_is_halfway(drone: Any, virtual_clock: Any, steps: Any) -> None:
    (step,) = steps().fly("home", "shop", length_m=6000, duration_s=300, lands=False).made
    vehicle = SimulatedVehicle(drone.model, virtual_clock)

    sample = vehicle.sample(run_of(step), step.planned_start_at + timedelta(seconds=150))

    assert sample.position.longitude_deg == pytest.approx(-97.9, abs=1e-6)
    assert sample.soc == pytest.approx(1 - 150 * 100 / 360_000)
    assert (sample.speed_mps, sample.power_w) == (20.0, 100.0)


def test_a_sample_on_the_pad_shows_the_charge_so_far(
    drone: Any, virtual_clock: Any, steps: Any
) -> None:
    (step,) = steps().recharge("shop", until_soc=0.8, duration_s=1800).made
    vehicle = SimulatedVehicle(drone.model, virtual_clock)

    sample = vehicle.sample(run_of(step, soc=0.4), step.planned_start_at + timedelta(seconds=900))

    assert sample.soc == pytest.approx(0.6)
    assert sample.speed_mps == 0.0
