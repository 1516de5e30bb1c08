"""The model of one drone, with what its flights have shown."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skyway.drone.charging import recharge_time_s
from skyway.drone.flight import flight_energy_j, flight_time_s
from skyway.drone.learned_values import (
    AS_MODELLED,
    CHARGE_RATE_BOUNDS,
    HEALTH_BOUNDS,
    STILL_AIR_BOUNDS,
    LearnedValues,
    model_as_learned,
)
from skyway.drone.model import DroneModel
from skyway.drone.models import DJI_MATRICE_300_RTK, DRONE_MODELS

MODEL = DJI_MATRICE_300_RTK

values = st.builds(
    LearnedValues,
    still_air_factor=st.floats(*STILL_AIR_BOUNDS),
    state_of_health=st.floats(*HEALTH_BOUNDS),
    charge_rate_factor=st.floats(*CHARGE_RATE_BOUNDS),
)


def test_a_drone_that_is_as_its_model_is_planned_with_this_model() -> None:
    assert model_as_learned(MODEL, AS_MODELLED) == MODEL


@settings(max_examples=30, deadline=None)
@given(learned=values, model=st.sampled_from(sorted(DRONE_MODELS.values(), key=str)))
def test_flights_and_recharges_differ_by_the_learned_values_only(
    learned: LearnedValues, model: DroneModel
) -> None:
    # A model that has cached its charge curve as columns.
    full_s = recharge_time_s(model, 0.2, 0.9)
    energy_j = flight_energy_j(model, length_m=10_000, load_kg=1.0)

    planned = model_as_learned(model, learned)

    assert DroneModel.model_validate(planned.model_dump()) == planned
    assert (planned.model_id, planned.reserve_soc) == (model.model_id, model.reserve_soc)
    assert flight_energy_j(planned, length_m=10_000, load_kg=1.0) == pytest.approx(
        energy_j * learned.still_air_factor
    )
    assert flight_time_s(planned, length_m=10_000, load_kg=1.0) == pytest.approx(
        flight_time_s(model, length_m=10_000, load_kg=1.0)
    )
    assert planned.battery_j == pytest.approx(model.battery_j * learned.state_of_health)
    assert recharge_time_s(planned, 0.2, 0.9) == pytest.approx(full_s / learned.charge_rate_factor)


def test_a_report_is_compared_with_what_was_learned_already() -> None:
    worn = LearnedValues(still_air_factor=1.1, state_of_health=0.88)

    assert worn.beyond(1.25) == pytest.approx(1.0)
    assert worn.beyond(1.5) == pytest.approx(1.2)


def test_the_cold_slows_a_drone_that_charges_slowly_already() -> None:
    slow = LearnedValues(charge_rate_factor=0.9)

    assert AS_MODELLED.in_cold(-8.0).charge_rate_factor == 0.7
    assert slow.in_cold(-8.0).charge_rate_factor == 0.65
    assert slow.in_cold(15.0) is slow
