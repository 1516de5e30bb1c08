"""The planned weather of a drone's next flights counts by energy, as the drone counts it."""

import math
from collections.abc import Callable
from datetime import UTC, datetime

import pytest
from skyway_composition.missions.replanning.felt_wind import (
    air_ahead,
    first_flights,
    next_flights,
    planned_air,
)

from skyway.contracts.flight_step import FlightStep, FlyStep, RechargeStep
from skyway.delivery.plan import Fly, Recharge, Step
from skyway.drone.flight import flight_energy_j
from skyway.drone.models import PAPER_SCENARIO
from skyway.geo import Position
from skyway.ids import PackageId, StationId

AT = datetime(2026, 3, 1, 12, tzinfo=UTC)
A, B, C = StationId("a"), StationId("b"), StationId("c")

#: A short flight against the wind, a long one across it, and one after the recharge: lengths in
#: metres, and what the weather multiplies their energy by.
FLIGHTS = ((1_000.0, 2.0), (9_000.0, 1.0), (5_000.0, 3.0))


def make_flight(number: int, length_m: float, factor: float, *, lands: bool) -> FlyStep:
    return FlyStep(
        step_id=number,
        planned_start_at=AT,
        planned_end_at=AT,
        from_id=A,
        to_id=B,
        from_position=Position(-98.0, 29.0),
        to_position=Position(-98.0, 29.1),
        length_m=length_m,
        lands=lands,
        time_factor=factor,
    )


def test_a_long_flight_counts_more_than_a_short_one_up_to_the_recharge() -> None:
    first, second, last = FLIGHTS
    charge = RechargeStep(
        step_id=3,
        planned_start_at=AT,
        planned_end_at=AT,
        station_id=C,
        pad=0,
        until_soc=1.0,
        not_before_at=AT,
        not_after_at=AT,
    )
    steps: list[FlightStep] = [
        make_flight(1, *first, lands=False),
        make_flight(2, *second, lands=True),
        charge,
        make_flight(4, *last, lands=True),
    ]

    packages = {PackageId("p"): 1.0}

    def in_air(air: Callable[[FlyStep], float]) -> float:
        flights = next_flights(steps, PAPER_SCENARIO, masses_kg=packages, carried=packages, air=air)
        return air_ahead(flights)

    assert in_air(planned_air) == pytest.approx(1.1)
    # A segment that the weather closes says nothing about energy.
    assert in_air(lambda flight: 1.2 if flight.step_id == 1 else math.inf) == pytest.approx(1.2)
    assert air_ahead([]) == 1.0


def test_the_flights_of_a_plan_count_without_their_landings() -> None:
    steps: list[Step] = []
    for length_m, factor in FLIGHTS:
        if len(steps) == 2:
            steps.append(
                Recharge(station_id=C, pad=0, start_s=0, end_s=1, soc_start=0.5, soc_end=1.0)
            )
        energy_j = factor * flight_energy_j(PAPER_SCENARIO, length_m=length_m, load_kg=0.0)
        landing_j = PAPER_SCENARIO.stop_j if length_m != FLIGHTS[0][0] else 0.0
        steps.append(
            Fly(
                from_id=A,
                to_id=B,
                start_s=0,
                end_s=1,
                load_kg=0.0,
                energy_j=energy_j + landing_j,
                soc_end=0.5,
                time_factor=factor,
            )
        )

    assert air_ahead(first_flights(steps, PAPER_SCENARIO)) == pytest.approx(1.1)
