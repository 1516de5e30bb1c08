"""The table of failsafes: complete, in order of danger, and as the documentation shows it."""

from pathlib import Path
from typing import Any

import pytest
from skyway_drone_agent.failsafes.failsafe import (
    TABLE,
    Situation,
    failsafe_for,
    in_order_of_danger,
    severest,
    situation_of,
)
from skyway_drone_agent.failsafes.faults import in_words, level_of

from skyway.contracts.drone_report import Failsafe, Fault

DOCUMENT = Path(__file__).parents[3] / "docs" / "failsafes.md"

PAIRS = [(situation, fault) for situation in Situation for fault in Fault]

TURNING = {Failsafe.DIVERT, Failsafe.LAND_NOW}


@pytest.mark.parametrize(("situation", "fault"), PAIRS)
def test_every_pair_has_a_failsafe_that_can_be_done_there(
    situation: Situation, fault: Fault
) -> None:
    failsafe = failsafe_for(situation, fault)

    assert (failsafe in TURNING) <= (situation is Situation.FLYING)
    assert (failsafe is Failsafe.WAIT_THEN_ASK) <= (situation is Situation.RECHARGING)
    assert (failsafe in {Failsafe.STAY, Failsafe.ASK}) <= (situation is not Situation.FLYING)
    assert (failsafe not in {Failsafe.GO_ON, Failsafe.WARN}) <= (situation is not Situation.DOWN)


def test_the_table_has_every_fault_and_every_situation() -> None:
    assert set(TABLE) == set(Fault)
    assert {len(row) for row in TABLE.values()} == {len(Situation)}


def test_the_documentation_shows_the_table_row_by_row() -> None:
    lines = DOCUMENT.read_text().splitlines()
    rows = [[cell.strip() for cell in line.strip("| ").split("|")] for line in lines]
    shown = {row[0]: row[1:] for row in rows if row[0] in Fault.__members__}
    header = next(row for row in rows if row[0] == "fault")

    assert header[1:] == [situation.name for situation in Situation]
    assert list(shown) == [fault.value for fault in TABLE]
    for fault, failsafes in TABLE.items():
        assert shown[fault.value] == [failsafe.value for failsafe in failsafes], fault


def test_the_documentation_shows_the_level_of_every_alarm() -> None:
    lines = DOCUMENT.read_text().splitlines()

    for fault in Fault:
        documented = next(line for line in lines if line.startswith(f"- `{fault.value}`"))
        assert f"({level_of(fault) or 'no alarm'})" in documented, fault


def test_the_severest_failsafe_acts_and_of_equal_ones_the_more_dangerous_fault() -> None:
    flying, standing = Situation.FLYING, Situation.STANDING

    assert severest(flying, [Fault.GEOFENCE, Fault.BATTERY_EMPTY, Fault.LINK_LOST]) == (
        Fault.BATTERY_EMPTY,
        Failsafe.LAND_NOW,
    )
    assert severest(flying, [Fault.GEOFENCE, Fault.BATTERY_SHORT]) == (
        Fault.BATTERY_SHORT,
        Failsafe.DIVERT,
    )
    assert severest(standing, [Fault.BATTERY_LOW, Fault.GEOFENCE]) is None
    assert severest(standing, []) is None


def test_a_battery_fault_is_worse_than_the_geofence_and_that_than_the_link() -> None:
    faults = [Fault.LINK_LOST, Fault.GEOFENCE, Fault.BATTERY_SHORT, Fault.BATTERY_EMPTY]

    assert in_order_of_danger(faults) == tuple(reversed(faults))


@pytest.mark.parametrize(("situation", "fault"), PAIRS)
def test_each_failsafe_is_described_in_words(situation: Situation, fault: Fault) -> None:
    assert "; the drone " in in_words(fault, failsafe_for(situation, fault))


def test_a_drone_in_the_air_between_two_flights_flies(drone: Any) -> None:
    home = drone.at_first()

    assert situation_of(home) is Situation.STANDING
    assert situation_of(home.model_copy(update={"station_id": None})) is Situation.FLYING
    down = home.model_copy(update={"station_id": None, "is_down": True})
    assert situation_of(down) is Situation.DOWN
