"""Drones accept the mission of the fleet benchmark."""

import math
from datetime import UTC, datetime, timedelta

import pytest
from skyway_drone_agent.messages.refusal import refusal_of
from skyway_drone_agent.simulated.disturbances import UNDISTURBED
from skyway_drone_agent.simulated.vehicle import SimulatedVehicle
from skyway_lab.benchmarks.fleet.crew import crew_of
from skyway_lab.benchmarks.fleet.trip import trip_of

from skyway.runtime.clock import ManualClock

NOW = datetime(2026, 3, 1, 12, tzinfo=UTC)


@pytest.mark.parametrize("bearing_deg", [0, 45, 90, 180, 275])
def test_every_drone_accepts_its_trip_with_power_to_spare(bearing_deg: int) -> None:
    (drone,) = crew_of(1, seed=bearing_deg)
    vehicle = SimulatedVehicle(drone.model, ManualClock(NOW), disturbances=UNDISTURBED)
    trip = trip_of(drone, bearing_rad=math.radians(bearing_deg), now=NOW)

    refusal = refusal_of(
        trip, drone.at_first(), vehicle=vehicle, now=NOW, energy_use=lambda _flights: 1.5
    )

    assert refusal is None


def test_a_trip_lasts_longer_than_a_run() -> None:
    (drone,) = crew_of(1, seed=1)

    out, home = trip_of(drone, bearing_rad=1.0, now=NOW).steps

    assert out.planned_end_at - NOW > timedelta(minutes=5)
    assert home.planned_end_at - NOW > timedelta(minutes=10)


def test_the_same_seed_makes_the_same_crew() -> None:
    assert crew_of(5, seed=3) == crew_of(5, seed=3)
    assert len({drone.drone_id for drone in crew_of(50, seed=3)}) == 50
