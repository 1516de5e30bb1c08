"""A disturbed drone does what it does at the disturbed times and energies, and says so."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.simulated.disturbances import Disturbances
from skyway_drone_agent.simulated.physics import Physics
from skyway_drone_agent.vehicle import StepRun

from skyway.geo import Position
from skyway.ids import StationId


def run_of(step: Any, *, soc: float = 1.0, load_kg: float = 0.0) -> StepRun:
    return StepRun(
        step=step,
        started_at=step.planned_start_at,
        soc=soc,
        load_kg=load_kg,
        position=Position(-98.0, 30.0),
    )


def test_a_slow_flight_takes_longer_and_its_samples_lag(drone: Any, steps: Any) -> None:
    (step,) = steps().fly("home", "shop", length_m=6000, duration_s=330).made
    physics = Physics(drone.model, Disturbances(flight_time_factor=2.0))

    outcome = physics.outcome_of(run_of(step))
    sample = physics.sample(run_of(step), step.planned_start_at + timedelta(seconds=300))

    assert outcome.ended_at - step.planned_start_at == timedelta(seconds=2 * 300 + 30)
    assert outcome.energy_j == pytest.approx(300 * 100 + 1000)
    assert sample.position.longitude_deg == pytest.approx(-97.9, abs=1e-6)
    assert (sample.speed_mps, sample.power_w) == (10.0, 50.0)


def test_a_flight_against_the_wind_draws_more(drone: Any, steps: Any) -> None:
    (step,) = steps().fly("home", "shop", length_m=6000, duration_s=300, lands=False).made
    physics = Physics(drone.model, Disturbances(flight_energy_factor=1.5))

    outcome = physics.outcome_of(run_of(step))
    sample = physics.sample(run_of(step), step.planned_start_at + timedelta(seconds=150))

    assert outcome.ended_at - step.planned_start_at == timedelta(seconds=300)
    assert outcome.energy_j == pytest.approx(1.5 * 300 * 100)
    assert outcome.soc == pytest.approx(1 - 1.5 * 300 * 100 / 360_000)
    assert sample.soc == pytest.approx(1 - 1.5 * 150 * 100 / 360_000)


def test_a_pad_with_little_power_charges_as_fast_as_it_can(drone: Any, steps: Any) -> None:
    (own,) = steps().recharge("shop", until_soc=0.8, duration_s=9000).made
    limited = own.model_copy(update={"power_w": 20.0})
    tight = limited.model_copy(update={"not_after_at": own.planned_start_at + timedelta(hours=1)})
    started_at, battery_j = own.planned_start_at, drone.model.battery_j

    for factor in (1.0, 1.5):
        physics = Physics(drone.model, Disturbances(charge_time_factor=factor))
        full, short = (physics.outcome_of(run_of(step, soc=0.4)) for step in (limited, tight))
        sample = physics.sample(run_of(limited, soc=0.4), started_at + timedelta(hours=0.5))

        assert (full.ended_at - started_at).total_seconds() == pytest.approx(0.4 * battery_j / 20.0)
        assert short.code == "SHORT_CHARGE"
        assert short.soc == pytest.approx(0.4 + 72_000 / battery_j)
        assert sample.soc == pytest.approx(0.4 + 36_000 / battery_j)


def test_a_slow_charger_charges_longer_or_short(drone: Any, steps: Any) -> None:
    (ample,) = steps().recharge("shop", until_soc=0.8, duration_s=1800, spare_s=1800).made
    (tight,) = steps().recharge("shop", until_soc=0.8, duration_s=1800).made
    physics = Physics(drone.model, Disturbances(charge_time_factor=2.0))

    full, short = (physics.outcome_of(run_of(step, soc=0.4)) for step in (ample, tight))
    sample = physics.sample(run_of(ample, soc=0.4), ample.planned_start_at + timedelta(hours=0.5))

    assert (full.soc, full.code) == (0.8, None)
    assert full.ended_at - ample.planned_start_at == timedelta(seconds=3600)
    assert (short.ended_at, short.code) == (tight.not_after_at, "SHORT_CHARGE")
    assert short.soc == sample.soc == pytest.approx(0.6)


def test_without_a_recipient_the_drone_waits_and_the_step_fails(drone: Any, steps: Any) -> None:
    (step,) = steps().deliver("shop", "p1", recipient_wait_s=300).made
    absent_recipient = Disturbances(absent_station_ids=frozenset({StationId("shop")}))

    outcome = Physics(drone.model, absent_recipient).outcome_of(run_of(step))

    assert outcome.ended_at - step.planned_start_at == timedelta(seconds=300)
    assert (outcome.has_failed, outcome.code) == (True, "RECIPIENT_ABSENT")


def test_a_return_succeeds_even_where_recipients_are_absent(drone: Any, steps: Any) -> None:
    (step,) = steps().bring_back("shop", "p1").made
    absent_recipient = Disturbances(absent_station_ids=frozenset({StationId("shop")}))

    assert not Physics(drone.model, absent_recipient).outcome_of(run_of(step)).has_failed
