"""How fast the system is back after a fault."""

import pytest
from skyway_lab.benchmarks.chaos.evidence import Received
from skyway_lab.benchmarks.chaos.recovery import Healed, Recovery, middle_and_worst, recoveries

from skyway.ids import DeliveryId
from tests.lab.benchmarks.chaos.test_judgement import make_event

OLD, NEW = DeliveryId("dlv_old"), DeliveryId("dlv_new")


def make_received(planned_s: float, dispatched_s: float) -> list[Received]:
    return [
        Received(make_event("delivery.planned", 2), planned_s),
        Received(make_event("delivery.dispatched", 3), dispatched_s),
    ]


def test_only_requests_that_were_accepted_after_the_fault_count() -> None:
    received = {OLD: make_received(101.0, 102.0), NEW: make_received(104.0, 106.0)}

    [found] = recoveries([Healed("kill", 100.0)], {OLD: 99.0, NEW: 103.0}, received)

    assert found == Recovery("kill", accepted_s=3.0, planned_s=4.0, dispatched_s=6.0)


def test_what_comes_after_the_next_fault_does_not_count() -> None:
    healed = Healed("kill", 100.0, next_fault_s=103.5)

    [found] = recoveries([healed], {NEW: 103.0}, {NEW: make_received(104.0, 106.0)})

    assert found == Recovery("kill", 3.0, None, None, was_interrupted=True)


def make_found(*accepted: float | None, was_interrupted: bool = False) -> list[Recovery]:
    return [Recovery("kill", each, None, None, was_interrupted) for each in accepted]


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (make_found(3.0, 1.0, 2.0), "2.0 / 3.0"),
        (make_found(1.0, 2.0), "1.0 / 2.0"),
        (make_found(1.0, None), "1.0 / never"),
        (make_found(1.0) + make_found(None, was_interrupted=True), "1.0 / 1.0"),
        (make_found(None, was_interrupted=True), "interrupted"),
    ],
)
def test_figures_are_the_median_and_the_worst(found: list[Recovery], words: str) -> None:
    assert middle_and_worst(found, lambda each: each.accepted_s) == words
