"""From a planned trip to the steps that a drone flies."""

from typing import Any

import pytest
from skyway_composition.missions.mission.from_trip import StepTerms, flight_steps

from skyway.contracts.flight_step import DeliverStep, FlyStep, PickUpStep, RechargeStep, WaitStep
from skyway.delivery.plan import Deliver, Fly, PickUp, Recharge, Step, Wait
from skyway.delivery.verification import PlannedVerification
from skyway.ids import PackageId, StationId
from skyway.network.geojson import read_network
from skyway.scheduling.trip import PlacedStep
from skyway.units import moment_to_ms

A, B, C = StationId("a"), StationId("b"), StationId("c")
P1 = PackageId("p1")

_START_MS = 1_000_000_000_000


def fly(start: StationId, end: StationId, start_s: float, end_s: float) -> Fly:
    return Fly(
        from_id=start, to_id=end, start_s=start_s, end_s=end_s, load_kg=1, energy_j=1, soc_end=0.5
    )


def sent(make: Any, *steps: Step, first_step: int = 1, **terms: Any) -> Any:
    return flight_steps(
        read_network(make.network()),
        [PlacedStep(_START_MS, step) for step in steps],
        terms=StepTerms(masses_kg={P1: 0.4}, **terms),
        first_step=first_step,
    )


def test_a_flight_lands_unless_another_follows(make: Any) -> None:
    over, landing = sent(make, fly(A, B, 0, 10), fly(B, C, 10, 20))

    assert isinstance(over, FlyStep)
    assert isinstance(landing, FlyStep)
    assert (over.lands, landing.lands) == (False, True)
    assert (landing.from_position, landing.to_position) != (over.from_position, over.to_position)


def test_a_flight_before_a_recharge_lands(make: Any) -> None:
    charging = Recharge(
        station_id=B, pad=1, start_s=10, end_s=20, soc_start=0.5, soc_end=0.7, power_w=400
    )

    flight, recharge = sent(make, fly(A, B, 0, 10), charging)

    assert isinstance(flight, FlyStep)
    assert isinstance(recharge, RechargeStep)
    assert flight.lands
    assert (recharge.pad, recharge.until_soc, recharge.power_w) == (1, 0.7, 400)


def test_a_recharge_may_last_as_long_as_its_pad_is_reserved(make: Any) -> None:
    charging = Recharge(
        station_id=B, pad=0, start_s=10.0004, end_s=20.0001, soc_start=0.5, soc_end=0.7
    )

    (recharge,) = sent(make, charging)

    assert isinstance(recharge, RechargeStep)
    assert moment_to_ms(recharge.not_before_at) == _START_MS + 10_000
    assert moment_to_ms(recharge.not_after_at) == _START_MS + 20_001


def test_steps_are_numbered_from_the_given_first_step(make: Any) -> None:
    steps = sent(make, fly(A, B, 0, 10), fly(B, C, 10, 20), first_step=7)

    assert [step.step_id for step in steps] == [7, 8]


def test_hand_overs_name_the_packages_and_their_masses(make: Any) -> None:
    pick_up, wait, deliver = sent(
        make,
        PickUp(station_id=A, package_ids=(P1,), start_s=0, end_s=60),
        Wait(station_id=A, start_s=60, end_s=70),
        Deliver(station_id=A, package_ids=(P1,), start_s=70, end_s=100),
    )

    assert isinstance(pick_up, PickUpStep)
    assert isinstance(wait, WaitStep)
    assert isinstance(deliver, DeliverStep)
    assert [(each.package_id, each.mass_kg) for each in pick_up.packages] == [("p1", 0.4)]
    assert wait.until_at == deliver.planned_start_at
    assert (deliver.package_ids, deliver.dropoff_s) == ((P1,), 30)


@pytest.mark.parametrize(
    ("wait_s", "proof_wait_s", "recipient_wait_s", "expected_s"),
    [
        (45, 0.0, 300.0, 45.0),
        (None, 0.0, 300.0, 300.0),
        (None, 0.0, 20.0, 60.0),
        (45, 1e4, 9.0, 1e4),
    ],
    ids=["as asked", "as the network", "at least a minute", "on a fast clock"],
)
def test_a_drone_waits_for_a_proof_as_asked_but_long_enough_for_programs(
    make: Any, wait_s: int | None, proof_wait_s: float, recipient_wait_s: float, expected_s: float
) -> None:
    asked = PlannedVerification(method="PHOTO", wait_s=wait_s, upload_path="/up/1")
    hand_over = Deliver(station_id=B, package_ids=(P1,), start_s=0, end_s=60)

    (step,) = sent(
        make,
        hand_over,
        dropoff_s=30.0,
        recipient_wait_s=recipient_wait_s,
        proof_wait_s=proof_wait_s,
        verified={P1: asked},
    )

    assert isinstance(step, DeliverStep)
    assert (step.recipient_wait_s, step.dropoff_s) == (expected_s, 30.0)
    assert [each.upload_path for each in step.verification] == ["/up/1"]


def test_a_package_that_is_handed_back_needs_no_proof(make: Any) -> None:
    asked = PlannedVerification(method="PIN")
    back = Deliver(station_id=A, package_ids=(P1,), start_s=0, end_s=60)

    (step,) = sent(make, back, verified={P1: asked}, returned=frozenset({P1}))

    assert step.kind == "RETURN"
