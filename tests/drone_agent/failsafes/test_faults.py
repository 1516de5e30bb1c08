"""Faults: they begin at a limit that lasts, and end beyond a margin."""

from dataclasses import dataclass, replace
from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.analysis.analysis import Analysis
from skyway_drone_agent.analysis.reach import LandingInReach, NextLanding
from skyway_drone_agent.failsafes.failsafe import Situation
from skyway_drone_agent.failsafes.faults import SYMPTOMS, FaultMonitor, Signs, empty_soc
from skyway_drone_agent.journal.logbook import doing_now
from skyway_drone_agent.simulated.vehicle import SimulatedVehicle

from skyway.contracts.drone_report import Fault
from skyway.geo import Position
from skyway.ids import StationId

SECOND = timedelta(seconds=1)

#: A value that begins a fault, a value that keeps it, a value that ends it.
LIMITS = [
    (Fault.BATTERY_HOT, "temperature_c", 60.5, 56.0, 54.5),
    (Fault.BATTERY_COLD, "temperature_c", -0.5, 2.0, 3.5),
    (Fault.CELL_IMBALANCE, "cell_spread_v", 0.11, 0.08, 0.06),
    (Fault.BATTERY_WORN, "state_of_health", 0.79, 0.81, 0.83),
    (Fault.GEOFENCE, "off_course_m", 201.0, 160.0, 149.0),
]


@pytest.fixture
def signs(drone: Any, virtual_clock: Any) -> Signs:
    """A drone in flight without a fault."""
    vehicle, logbook = SimulatedVehicle(drone.model, virtual_clock), drone.at_first()
    reading = vehicle.read(doing_now(logbook), virtual_clock.now())
    assessment = Analysis(drone.model).assess(reading, logbook)
    return Signs(assessment=assessment, situation=Situation.FLYING, reserve_soc=0.1)


def at(signs: Signs, seconds: float, **assessed: Any) -> Signs:
    moment = signs.assessment.at + seconds * SECOND
    return replace(signs, assessment=replace(signs.assessment, at=moment, **assessed))


@dataclass(frozen=True)
class KnownReach:
    """The answer to one question, known beforehand."""

    in_reach: tuple[LandingInReach, ...]

    def landings_in_reach(self, *_: Any, **__: Any) -> tuple[LandingInReach, ...]:
        return self.in_reach


def landing(soc: float, *others: float) -> dict[str, Any]:
    """Predicted charges at the planned landing, and at others that can be reached."""
    position = Position(-98.0, 30.0)
    in_reach = tuple(
        LandingInReach(StationId(f"s{n}"), position, 1.0, other, is_safe=False)
        for n, other in enumerate(others)
    )
    return {"landing": NextLanding(StationId("end"), 1.0, soc), "reach": KnownReach(in_reach)}


def test_good_values_are_no_fault(signs: Signs) -> None:
    monitor = FaultMonitor(())

    assert [monitor.update(at(signs, seconds)) for seconds in range(100)] == [()] * 100


@pytest.mark.parametrize(("fault", "name", "begins", "keeps", "ends"), LIMITS)
def test_a_fault_must_last_lingers_and_ends_beyond_its_margin(
    signs: Signs, fault: Fault, name: str, begins: float, keeps: float, ends: float
) -> None:
    monitor, lasts_s = FaultMonitor(()), SYMPTOMS[fault].lasts_s

    assert fault not in monitor.update(at(signs, 0, **{name: keeps}))
    assert fault not in monitor.update(at(signs, 1, **{name: begins}))
    assert fault not in monitor.update(at(signs, lasts_s, **{name: begins}))
    assert fault in monitor.update(at(signs, 1 + lasts_s, **{name: begins}))
    assert fault in monitor.update(at(signs, 2 + lasts_s, **{name: keeps}))
    assert fault not in monitor.update(at(signs, 3 + lasts_s, **{name: ends}))


@pytest.mark.parametrize(("fault", "name", "begins", "keeps", "ends"), LIMITS)
def test_a_symptom_that_comes_and_goes_is_no_fault(
    signs: Signs, fault: Fault, name: str, begins: float, keeps: float, ends: float
) -> None:
    monitor = FaultMonitor(())

    for seconds in range(0, 300, 2):
        assert monitor.update(at(signs, seconds, **{name: begins})) == ()
        assert monitor.update(at(signs, seconds + 1, **{name: ends})) == ()


@pytest.mark.parametrize(
    ("predicted", "others", "faults"),
    [
        (0.100, (), ()),
        (0.096, (), ()),
        (0.094, (), (Fault.BATTERY_LOW,)),
        (0.050, (0.9,), (Fault.BATTERY_LOW,)),
        (0.048, (), (Fault.BATTERY_LOW,)),
        (0.048, (0.06,), (Fault.BATTERY_LOW,)),
        (0.048, (0.07,), (Fault.BATTERY_SHORT, Fault.BATTERY_LOW)),
        (0.018, (0.9,), (Fault.BATTERY_SHORT, Fault.BATTERY_LOW)),
        (0.018, (), (Fault.BATTERY_EMPTY, Fault.BATTERY_LOW)),
        (-0.4, (0.01,), (Fault.BATTERY_EMPTY, Fault.BATTERY_SHORT, Fault.BATTERY_LOW)),
    ],
)
def test_the_three_battery_levels(
    signs: Signs, predicted: float, others: tuple[float, ...], faults: tuple[Fault, ...]
) -> None:
    monitor = FaultMonitor(())

    monitor.update(at(signs, 0, **landing(predicted, *others)))
    assert monitor.update(at(signs, 5, **landing(predicted, *others))) == faults


@pytest.mark.parametrize("reserve_soc", [0.0, 0.01, 0.1, 0.3])
def test_a_plan_that_lands_with_exactly_its_reserve_has_no_battery_fault(
    signs: Signs, reserve_soc: float
) -> None:
    monitor, close = FaultMonitor(()), replace(signs, reserve_soc=reserve_soc)

    for seconds in range(20):
        assert monitor.update(at(close, seconds, **landing(reserve_soc - 1e-9, 0.9))) == ()


def test_a_drone_without_a_reserve_lands_on_the_spot_only_when_empty() -> None:
    assert empty_soc(0.0) < 0.0
    assert empty_soc(0.1) == pytest.approx(0.019)


def test_on_the_ground_no_prediction_is_a_fault(signs: Signs) -> None:
    monitor, standing = FaultMonitor(()), replace(signs, situation=Situation.STANDING)

    monitor.update(at(standing, 0, **landing(-1.0)))
    assert monitor.update(at(standing, 60, **landing(-1.0))) == ()


def test_a_motor_failure_counts_immediately_and_a_lost_position_after_30_s(signs: Signs) -> None:
    monitor = FaultMonitor(())

    assert monitor.update(at(signs, 0, motors_work=False, has_gps=False)) == (Fault.MOTOR_FAILURE,)
    assert monitor.update(at(signs, 29, has_gps=False)) == ()
    assert monitor.update(at(signs, 30, has_gps=False)) == (Fault.GPS_LOST,)
    assert monitor.update(at(signs, 31)) == ()


def test_a_drone_without_a_position_is_not_off_its_course(signs: Signs) -> None:
    monitor = FaultMonitor(())

    for seconds in range(10):
        assert monitor.update(at(signs, seconds, off_course_m=900.0, has_gps=False)) == ()


@pytest.mark.parametrize(
    ("sign", "fault"),
    [
        ("is_link_lost", Fault.LINK_LOST),
        ("is_cloud_silent", Fault.CLOUD_SILENT),
        ("is_disk_full", Fault.DISK_FULL),
        ("is_expired", Fault.INSTRUCTION_EXPIRED),
    ],
)
def test_stations_read_for_other_drones_count_immediately(
    signs: Signs, sign: str, fault: Fault
) -> None:
    monitor = FaultMonitor(())
    changes: dict[str, Any] = {sign: True}

    assert monitor.update(replace(signs, **changes)) == (fault,)
    assert monitor.update(signs) == ()


def test_a_pad_matters_only_to_a_drone_that_would_charge_on_it(signs: Signs) -> None:
    monitor = FaultMonitor(())

    assert monitor.update(at(signs, 0, pad_is_free=False)) == ()
    charging = replace(signs, situation=Situation.RECHARGING)
    assert monitor.update(at(charging, 1, pad_is_free=False)) == (Fault.PAD_OCCUPIED,)


def test_after_a_restart_a_fault_lingers(signs: Signs) -> None:
    monitor = FaultMonitor([Fault.BATTERY_HOT])

    assert monitor.update(at(signs, 0, temperature_c=56.0)) == (Fault.BATTERY_HOT,)
