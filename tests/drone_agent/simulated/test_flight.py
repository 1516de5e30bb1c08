"""A flight under disturbances: its time, its energy, and what its sensors show on the way."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.simulated.disturbances import (
    Battery,
    Disturbances,
    Drift,
    GpsLoss,
    MotorFailure,
    Sensors,
    Wind,
    read_scenario,
)
from skyway_drone_agent.simulated.physics import Physics
from skyway_drone_agent.simulated.vehicle import reading_of
from skyway_drone_agent.vehicle import StepRun

from skyway.geo import distance_m
from skyway.ids import DroneId

ME = DroneId("drn_1")

#: East, 6 km at 20 m/s, as the drone's model has it: 300 s and 30 kJ, then the landing.
EAST_WIND, WEST_WIND = (Wind(mean_mps=5.0, from_deg=degrees) for degrees in (90.0, 270.0))


@pytest.fixture
def run(steps: Any) -> StepRun:
    (step,) = steps().fly("home", "shop", length_m=6000, duration_s=330).made
    return StepRun(step, step.planned_start_at, soc=1.0, load_kg=0.0, position=step.from_position)


def flown_s(physics: Physics, run: StepRun) -> float:
    return (physics.outcome_of(run).ended_at - run.started_at).total_seconds() - 30.0


@pytest.mark.parametrize(("wind", "ground_mps"), [(EAST_WIND, 15.0), (WEST_WIND, 25.0)])
def test_wind_along_the_track_changes_time_and_energy_alike(
    drone: Any, run: StepRun, wind: Wind, ground_mps: float
) -> None:
    physics = Physics(drone.model, Disturbances(wind=wind))

    assert flown_s(physics, run) == pytest.approx(6000 / ground_mps, rel=1e-3)
    assert physics.outcome_of(run).energy_j == pytest.approx(
        100 * 6000 / ground_mps + 1000, rel=1e-3
    )


def test_wind_from_the_side_costs_what_holding_the_track_takes(drone: Any, run: StepRun) -> None:
    physics = Physics(drone.model, Disturbances(wind=Wind(mean_mps=12.0, from_deg=0.0)))

    assert flown_s(physics, run) == pytest.approx(6000 / 16.0, rel=1e-3)


def test_no_wind_stops_a_drone_for_ever(drone: Any, run: StepRun) -> None:
    physics = Physics(drone.model, Disturbances(wind=Wind(mean_mps=40.0, from_deg=90.0)))

    assert flown_s(physics, run) <= 6000 / 2.0


def test_ground_against_air_speed_shows_the_wind(drone: Any, run: StepRun) -> None:
    physics = Physics(drone.model, Disturbances(wind=EAST_WIND))

    reading = reading_of(physics, run, run.started_at + timedelta(seconds=100))

    assert reading.ground_mps[0] == pytest.approx(15.0, rel=1e-3)
    assert reading.ground_mps[0] - reading.air_mps[0] == pytest.approx(-5.0)


def test_a_sample_just_before_the_end_meets_the_outcome(drone: Any, run: StepRun) -> None:
    physics = Physics(drone.model, read_scenario("stormy"), drone_id=ME)

    outcome = physics.outcome_of(run)
    sample = physics.sample(run, outcome.ended_at)

    assert sample.soc == pytest.approx(outcome.soc, abs=1e-9)
    assert distance_m(sample.position, run.step.to_position) < 1.0  # type: ignore[union-attr]


def test_readings_do_not_depend_on_what_was_read_before(drone: Any, run: StepRun) -> None:
    stormy = read_scenario("stormy")
    moments = [run.started_at + timedelta(seconds=7 * n) for n in range(50)]
    one, other = (Physics(drone.model, stormy, drone_id=ME) for _ in range(2))

    forward = [reading_of(one, run, at) for at in moments]
    backward = [reading_of(other, run, at) for at in reversed(moments)]

    assert forward == backward[::-1]


def test_power_noise_differs_between_drones_and_flights(drone: Any, run: StepRun) -> None:
    noisy = Disturbances(power_noise=0.05)
    later = StepRun(run.step, run.started_at + timedelta(hours=1), 1.0, 0.0, run.position)

    used = {
        Physics(drone.model, noisy, drone_id=DroneId(name)).outcome_of(flight).energy_j
        for name in ("a", "b")
        for flight in (run, later)
    }

    assert len(used) == 4
    assert all(0.7 < (energy_j - 1000) / 30_000 < 1.3 for energy_j in used)


def test_without_gps_the_last_position_is_shown(drone: Any, run: StepRun) -> None:
    lost = Disturbances(gps=GpsLoss(share=1.0, after_s=60, for_s=100))
    physics = Physics(drone.model, lost, drone_id=ME)

    before, lost_at, during, after = (
        reading_of(physics, run, run.started_at + timedelta(seconds=seconds))
        for seconds in (59, 60, 159, 160)
    )

    assert [one.has_gps for one in (before, lost_at, during, after)] == [True, False, False, True]
    assert during.position == lost_at.position != after.position


def test_a_failed_motor_shows_and_costs(drone: Any, run: StepRun) -> None:
    fails = Disturbances(motor=MotorFailure(share=1.0, after_s=100, power_factor=1.5))
    physics = Physics(drone.model, fails, drone_id=ME)

    works, lame = (
        reading_of(physics, run, run.started_at + timedelta(seconds=seconds))
        for seconds in (99, 101)
    )

    assert (works.motors_work, lame.motors_work) == (True, False)
    assert lame.power_w == pytest.approx(150.0)
    assert physics.outcome_of(run).energy_j == pytest.approx(100 * 100 + 200 * 150 + 1000)


def test_a_drifting_drone_is_off_its_course_and_finds_back(drone: Any, run: StepRun) -> None:
    straight = Physics(drone.model, drone_id=ME)
    drifting = Physics(
        drone.model, Disturbances(drift=Drift(share=1.0, after_s=100, most_m=300)), drone_id=ME
    )

    off_m = [
        distance_m(straight.sample(run, at).position, drifting.sample(run, at).position)
        for at in (run.started_at + timedelta(seconds=seconds) for seconds in (99, 200, 299.9))
    ]

    assert off_m == [0.0, pytest.approx(300.0, rel=1e-3), pytest.approx(0.0, abs=1.0)]


def test_faults_happen_only_to_the_named_drones(drone: Any, run: StepRun) -> None:
    named = Disturbances(motor=MotorFailure(share=1.0, after_s=0, drone_ids=frozenset({ME})))

    works = [
        reading_of(Physics(drone.model, named, drone_id=name), run, run.started_at).motors_work
        for name in (ME, DroneId("drn_2"))
    ]

    assert works == [False, True]


def test_a_worn_battery_holds_less_and_its_cells_part(drone: Any, run: StepRun) -> None:
    worn = Disturbances(battery=Battery(worn_share=1.0, capacity=0.5, cell_spread_v=0.2))
    physics = Physics(drone.model, worn, drone_id=ME)

    outcome = physics.outcome_of(run)
    reading = reading_of(physics, run, outcome.ended_at)

    assert outcome.soc == pytest.approx(1 - 31_000 / 180_000)
    assert reading.consumed_j == pytest.approx(31_000)
    assert reading.cell_high_v - reading.cell_low_v == pytest.approx(0.2)


def test_sensors_have_the_given_errors(drone: Any, run: StepRun) -> None:
    exact = Physics(drone.model, drone_id=ME)
    vague = Physics(
        drone.model, Disturbances(sensors=Sensors(gps_m=3.0, voltage_v=0.1)), drone_id=ME
    )
    moments = [run.started_at + timedelta(seconds=n) for n in range(300)]

    pairs = [(reading_of(exact, run, at), reading_of(vague, run, at)) for at in moments]

    errors_m = [distance_m(true.position, shown.position) for true, shown in pairs]
    errors_v = [shown.voltage_v - true.voltage_v for true, shown in pairs]
    assert sum(error**2 for error in errors_m) / 300 == pytest.approx(2 * 3.0**2, rel=0.25)
    assert sum(error**2 for error in errors_v) / 300 == pytest.approx(0.1**2, rel=0.25)
