"""A drone at an occupied pad charges once the pad is free."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.simulated.disturbances import Disturbances, Pads, TakenPad
from skyway_drone_agent.simulated.physics import Physics, pad_free_at
from skyway_drone_agent.simulated.vehicle import reading_of
from skyway_drone_agent.vehicle import StepRun

from skyway.geo import Position
from skyway.ids import StationId


@pytest.fixture
def run(steps: Any) -> StepRun:
    """From 40 to 80 % in 1800 s, with 600 s to spare."""
    (step,) = steps().recharge("shop", until_soc=0.8, duration_s=1800, spare_s=600).made
    return StepRun(step, step.planned_start_at, 0.4, load_kg=0.0, position=Position(-97.8, 30.0))


def taken(run: StepRun, *, for_s: float, **other: Any) -> Disturbances:
    """Taken from a minute before the arrival on."""
    place = {"station_id": StationId("shop"), "from_at": run.started_at - timedelta(minutes=1)}
    until_at = run.started_at + timedelta(seconds=for_s)
    return Disturbances(pads=Pads(taken=(TakenPad(**place, until_at=until_at, **other),)))


def test_charging_begins_when_the_pad_is_free(drone: Any, run: StepRun) -> None:
    physics = Physics(drone.model, taken(run, for_s=300))

    outcome = physics.outcome_of(run)
    before, after = (
        reading_of(physics, run, run.started_at + timedelta(seconds=seconds))
        for seconds in (299, 300)
    )

    assert outcome.ended_at - run.started_at == timedelta(seconds=2100)
    assert (outcome.soc, outcome.code) == (0.8, None)
    assert (before.pad_is_free, after.pad_is_free) == (False, True)
    assert physics.sample(run, run.started_at + timedelta(seconds=299)).soc == 0.4


def test_a_pad_that_stays_taken_charges_nothing_and_the_step_fails(
    drone: Any, run: StepRun
) -> None:
    outcome = Physics(drone.model, taken(run, for_s=9_000)).outcome_of(run)

    assert (outcome.soc, outcome.code, outcome.has_failed) == (0.4, "PAD_OCCUPIED", True)
    assert outcome.ended_at == run.step.not_after_at  # type: ignore[union-attr]


@pytest.mark.parametrize("elsewhere", [{"pad": 1}, {"station_id": StationId("farm")}])
def test_another_pad_or_station_is_no_hindrance(
    drone: Any, run: StepRun, elsewhere: dict[str, Any]
) -> None:
    (here,) = taken(run, for_s=300).pads.taken
    other = Disturbances(pads=Pads(taken=(here.model_copy(update=elsewhere),)))

    assert Physics(drone.model, other).outcome_of(run) == Physics(drone.model).outcome_of(run)


def test_pads_are_occupied_for_about_the_given_share(steps: Any) -> None:
    disturbed = Disturbances(pads=Pads(taken_share=0.3, taken_s=600))
    (step,) = steps().recharge("shop", until_soc=0.8, duration_s=1800).made
    moments = [step.planned_start_at + timedelta(seconds=600 * n) for n in range(1_000)]

    waits = [pad_free_at(step, at, disturbed=disturbed) > at for at in moments]

    assert 0.25 < sum(waits) / len(waits) < 0.35
