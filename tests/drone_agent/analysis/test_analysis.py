"""The analysis over whole missions: exact when all goes by the model, fair when it does not."""

import math
from dataclasses import replace
from datetime import timedelta
from functools import cache
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skyway_drone_agent.analysis.analysis import Analysis
from skyway_drone_agent.simulated.disturbances import (
    UNDISTURBED,
    Disturbances,
    changed,
    read_scenario,
)
from skyway_lab.benchmarks.telemetry_thinning.flown import START, Flown, Moment
from skyway_lab.benchmarks.telemetry_thinning.round_trip import round_trip

from skyway.contracts.flight_step import FlyStep
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.ids import DroneId

MODEL = DJI_MATRICE_300_RTK.model_copy(update={"stop_s": 30.0, "stop_j": 20_000.0})


def flown(disturbances: Disturbances = UNDISTURBED) -> Flown:
    return Flown(MODEL, round_trip(MODEL, start_at=START), disturbances, drone_id=DroneId("drn_1"))


@cache
def undisturbed_moments() -> tuple[Moment, ...]:
    return tuple(flown().moments(every_s=5.0))


def scenario(name: str, **changes: Any) -> Disturbances:
    return changed(read_scenario(name), changes)


def test_without_disturbances_every_step_follows_the_model() -> None:
    analysis = Analysis(MODEL)

    for moment in undisturbed_moments():
        found = analysis.assess(moment.reading, moment.logbook)
        assert found.soc == pytest.approx(moment.true_soc, abs=1e-9)
        assert found.consumption_factor == pytest.approx(1.0, abs=1e-9)
        assert found.state_of_health == 1.0
        assert found.wind_mps in (None, (0.0, 0.0))
        assert found.off_course_m < 1e-3


def test_without_disturbances_the_predicted_charge_at_landing_is_exact() -> None:
    analysis, physics = Analysis(MODEL), flown().physics
    expected: list[float] = []
    landed: list[float] = []

    for moment in undisturbed_moments():
        found = analysis.assess(moment.reading, moment.logbook)
        step = moment.run.step
        if found.landing is not None and isinstance(step, FlyStep) and step.lands:
            expected.append(found.landing.soc_at_landing)
            landed.append(physics.outcome_of(moment.run).soc)

    assert len(landed) > 100
    assert expected == pytest.approx(landed, abs=1e-9)


@settings(max_examples=40)
@given(share=st.floats(0.0, 0.999))
def test_an_agent_that_restarts_in_a_step_estimates_the_charge(share: float) -> None:
    moments = undisturbed_moments()
    moment = moments[int(share * len(moments))]

    found = Analysis(MODEL).assess(moment.reading, moment.logbook)

    assert found.soc == pytest.approx(moment.true_soc, abs=1e-9)


def test_an_agent_that_restarts_in_headwind_estimates_the_energy_used() -> None:
    disturbances = changed(UNDISTURBED, {"wind": {"mean_mps": 8.0, "from_deg": 250.0}})
    moments = list(flown(disturbances).moments(every_s=20.0))

    errors = [
        Analysis(MODEL).assess(one.reading, one.logbook).soc - one.true_soc for one in moments
    ]

    assert max(map(abs, errors)) < 0.005


def test_the_kept_battery_health_counts_right_after_a_restart() -> None:
    disturbances = changed(
        UNDISTURBED, {"battery": {"worn_share": 1.0, "capacity": 0.75, "resistance_factor": 1.0}}
    )
    in_flight = [
        one for one in flown(disturbances).moments(every_s=20.0) if one.run.step.kind == "FLY"
    ]

    found = [
        Analysis(MODEL, state_of_health=0.75).assess(one.reading, one.logbook) for one in in_flight
    ]

    assert {one.state_of_health for one in found} == {0.75}
    errors = [one.soc - moment.true_soc for one, moment in zip(found, in_flight, strict=True)]
    assert max(map(abs, errors)) < 0.005


@pytest.mark.parametrize("factor", [0.8, 1.3])
def test_flights_that_take_more_show_in_the_consumption(factor: float) -> None:
    analysis = Analysis(MODEL)
    first_flight = (one for one in flown(Disturbances(flight_energy_factor=factor)).moments())
    factors = [
        analysis.assess(moment.reading, moment.logbook).consumption_factor
        for moment, _ in zip(first_flight, range(1_000), strict=False)
    ]

    assert factors[0] == 1.0
    assert factors[-1] == pytest.approx(factor, rel=0.02)
    assert max(abs(a - b) for a, b in pairwise(factors)) < 0.02


def test_a_head_wind_ahead_counts_before_it_is_flown_against() -> None:
    analysis = Analysis(MODEL)
    disturbances = changed(UNDISTURBED, {"wind": {"mean_mps": 8.0, "from_deg": 250.0}})
    ahead = []

    for moment in flown(disturbances).moments():
        found = analysis.assess(moment.reading, moment.logbook)
        if moment.run.step.kind == "DELIVER":
            ahead.append((found.consumption_factor, found.reach.still_air_factor))

    # From east to south, then home from south: against the wind.
    assert all(still == pytest.approx(1.0, abs=0.02) for _, still in ahead)
    assert ahead[-1][0] > 1.2


@settings(max_examples=8, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    mean_mps=st.floats(0.0, 9.0),
    from_deg=st.floats(0.0, 360.0),
    soc=st.floats(0.2, 0.9),
)
def test_a_landing_called_safe_can_be_reached_in_that_wind(
    seed: int, mean_mps: float, from_deg: float, soc: float
) -> None:
    wind = {"mean_mps": mean_mps, "from_deg": from_deg, "gust_mps": 0.5}
    disturbed = scenario("windy", seed=seed, wind=wind)
    plan = flown(disturbed)
    plan = Flown(plan.model, plan.steps, disturbed, plan.drone_id, soc=soc)
    analysis, physics, judged = Analysis(MODEL), plan.physics, 0

    for count, moment in enumerate(plan.moments(every_s=3.0)):
        found = analysis.assess(moment.reading, moment.logbook)
        step = moment.run.step
        if moment.true_soc <= 0.0:
            break
        if not isinstance(step, FlyStep) or count % 20 or count < 60:
            continue
        for landing in found.safe_landings:
            flight = step.model_copy(
                update={
                    "from_position": physics.sample(moment.run, found.at).position,
                    "to_position": landing.position,
                    "length_m": max(1.0, landing.distance_m),
                    "lands": True,
                }
            )
            run = type(moment.run)(
                flight, found.at, moment.true_soc, moment.run.load_kg, found.position
            )
            judged += 1
            assert physics.outcome_of(run).soc > 0.0, (count, landing)
    assert judged or soc < 0.6


numbers = st.floats(-1e3, 1e3)


@settings(max_examples=60, deadline=None)
@given(noise=st.lists(st.tuples(numbers, numbers, numbers, numbers), min_size=1, max_size=40))
def test_noise_never_makes_the_range_grow_without_bound(noise: list[tuple[float, ...]]) -> None:
    analysis = Analysis(MODEL)
    moments = [one for one in undisturbed_moments() if isinstance(one.run.step, FlyStep)]
    metre_j = MODEL.power_empty_w / MODEL.speed_empty_mps
    most_m = (1.0 - MODEL.reserve_soc) * MODEL.battery_j / metre_j / 0.5

    for moment, (volts, amperes, east, north) in zip(moments, noise, strict=False):
        true = moment.reading
        wrong = type(true)(
            at=true.at,
            position=true.position,
            ground_mps=(true.ground_mps[0] + east, true.ground_mps[1]),
            air_mps=(true.air_mps[0], true.air_mps[1] + north),
            voltage_v=true.voltage_v + volts,
            current_a=true.current_a + amperes,
            consumed_j=true.consumed_j + amperes * 1e3,
            cell_low_v=true.cell_low_v + volts,
            cell_high_v=true.cell_high_v - volts,
            temperature_c=volts,
        )
        found = analysis.assess(wrong, moment.logbook)
        assert 0.0 <= found.range_m <= most_m
        assert 0.0 <= found.soc <= 1.0
        assert 0.0 < found.soc_error < math.inf
        assert 0.0 < found.state_of_health <= 1.0
        assert found.consumption_factor > 0.0
        assert found.cell_spread_v >= 0.0


def test_the_distance_of_a_drifting_drone_from_its_leg_is_measured() -> None:
    drift = {"share": 1.0, "after_s": 60.0, "most_m": 400.0}
    analysis = Analysis(MODEL)

    off = [
        analysis.assess(moment.reading, moment.logbook).off_course_m
        for moment in flown(changed(UNDISTURBED, {"drift": drift})).moments(every_s=10.0)
    ]

    assert max(off) == pytest.approx(400.0, rel=0.02)


def test_the_landings_of_a_mission_are_remembered_after_they_were_passed() -> None:
    analysis, known = Analysis(MODEL), set()

    for moment in undisturbed_moments():
        found = analysis.assess(moment.reading, moment.logbook)
        if moment.run.step.step_id == 5:
            known = {landing.station_id for landing in found.landings_in_reach}

    assert known == {"home", "north", "east", "south"}


def test_range_and_charge_at_landing_fall_together_with_the_charge() -> None:
    analysis = Analysis(MODEL)
    flights = [one for one in undisturbed_moments() if one.run.step.step_id == 2]
    ranges = [analysis.assess(one.reading, one.logbook).range_m for one in flights]

    assert ranges == sorted(ranges, reverse=True)
    flown_m = MODEL.speed_empty_mps * timedelta(seconds=5).total_seconds()
    steps_m = [before - after for before, after in pairwise(ranges)]
    assert steps_m == pytest.approx([flown_m] * len(steps_m), rel=1e-6)


def test_a_battery_of_twelve_cells_has_the_same_charge_as_one_of_six() -> None:
    six, twelve = Analysis(MODEL), Analysis(MODEL)

    for moment in undisturbed_moments()[:50]:
        reading = moment.reading
        double = replace(
            reading, cells=12, voltage_v=2 * reading.voltage_v, current_a=reading.current_a / 2
        )
        expected = six.assess(reading, moment.logbook)
        found = twelve.assess(double, moment.logbook)
        assert (found.soc, found.soc_error) == (expected.soc, expected.soc_error)


def test_the_last_voltage_of_a_silent_battery_does_not_hold_the_charge() -> None:
    analysis = Analysis(MODEL)
    moment = undisturbed_moments()[0]
    first = analysis.assess(moment.reading, moment.logbook)

    for seconds in range(1, 100):
        silent = replace(
            moment.reading,
            at=moment.reading.at + timedelta(seconds=seconds),
            consumed_j=moment.reading.consumed_j + seconds * 0.001 * MODEL.battery_j,
            has_battery=False,
        )
        last = analysis.assess(silent, moment.logbook)

    assert first.soc - last.soc == pytest.approx(0.099)
