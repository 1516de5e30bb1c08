"""Sensors are read once for all who ask, and again when something has changed."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.analysis.analysis import Lookout
from skyway_drone_agent.journal.flight_recorder import FlightRecorder
from skyway_drone_agent.simulated.vehicle import SimulatedVehicle
from skyway_drone_agent.vehicle import Reading

from tests.drone_agent.memory_journal import MemoryJournal


class CountedVehicle(SimulatedVehicle):
    """A simulated vehicle that counts how often it is looked at."""

    reads = 0

    def read(self, doing: Any, at: Any) -> Reading:
        self.reads += 1
        return super().read(doing, at)


@pytest.fixture
def vehicle(drone: Any, virtual_clock: Any) -> CountedVehicle:
    """A drone at home, at clock rate 1."""
    virtual_clock.rate = 1.0
    return CountedVehicle(drone.model, virtual_clock)


@pytest.fixture
def recorder(drone: Any) -> FlightRecorder:
    """Its flight recorder."""
    return FlightRecorder(MemoryJournal(), drone_id=drone.drone_id, at_first=drone.at_first())


def test_a_changed_logbook_needs_a_new_assessment(
    recorder: FlightRecorder, vehicle: CountedVehicle, virtual_clock: Any
) -> None:
    lookout = Lookout(recorder, vehicle, virtual_clock)
    lookout.look()

    recorder.logbook = recorder.logbook.model_copy(update={"soc": 0.9})

    assert lookout.look().soc == pytest.approx(0.9)
    assert vehicle.reads == 2


def test_two_looks_at_one_moment_share_a_reading(
    recorder: FlightRecorder, vehicle: CountedVehicle, virtual_clock: Any
) -> None:
    lookout = Lookout(recorder, vehicle, virtual_clock)

    assert lookout.look() is lookout.look()
    assert vehicle.reads == 1


def test_a_fraction_of_a_second_is_one_moment(
    recorder: FlightRecorder, vehicle: CountedVehicle, virtual_clock: Any
) -> None:
    lookout = Lookout(recorder, vehicle, virtual_clock)
    guards = lookout.look()

    virtual_clock.move_to(virtual_clock.now() + timedelta(seconds=0.2))
    assert lookout.look() is guards

    virtual_clock.move_to(virtual_clock.now() + timedelta(seconds=0.1))
    assert lookout.look().at == virtual_clock.now()


def test_messages_to_the_cloud_need_no_new_reading(
    recorder: FlightRecorder, vehicle: CountedVehicle, virtual_clock: Any
) -> None:
    lookout = Lookout(recorder, vehicle, virtual_clock)
    guards = lookout.look()

    recorder.logbook = recorder.logbook.model_copy(update={"last_instruction_seq": 1})

    assert lookout.look() is guards
