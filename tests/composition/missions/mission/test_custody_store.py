from skyway_composition.missions.mission.custody_store import (
    Custodian,
    Held,
    delivered,
    may_pass,
    on_board,
)

from skyway.ids import PackageId

P1, P2 = PackageId("p1"), PackageId("p2")
DRONE = Custodian("DRONE", "drn_1")
RECIPIENT = Custodian("RECIPIENT", "c")


def test_a_package_passes_from_drone_to_recipient() -> None:
    assert may_pass(Held(P1, 2, DRONE), RECIPIENT)


def test_a_delivered_package_stays_with_its_recipient() -> None:
    assert not may_pass(Held(P1, 3, RECIPIENT), DRONE)


def test_a_package_cannot_pass_to_its_present_custodian() -> None:
    assert not may_pass(Held(P1, 2, DRONE), DRONE)


def test_packages_on_board_and_delivered_packages_are_distinguished() -> None:
    held = {P1: Held(P1, 2, DRONE), P2: Held(P2, 3, RECIPIENT)}

    assert on_board(held) == frozenset({P1})
    assert delivered(held) == frozenset({P2})
