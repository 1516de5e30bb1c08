"""People fetched a drone that was down, and say where it stands now."""

from pathlib import Path
from typing import Any

import pytest
from skyway_drone_agent.fleet import NotDown, place
from skyway_drone_agent.journal.journal import JournalFolder
from skyway_drone_agent.journal.records import Placed
from skyway_drone_agent.settings import read_settings

from skyway.errors import InvalidInput
from skyway.geo import Position
from skyway.ids import StationId
from skyway.runtime.errors import InvalidSettings

ARGUMENTS = ("--fleet", "f.json", "--journal", "j", "--mqtt-url", "mqtt://localhost:1883")

AT_FARM = Placed(station_id=StationId("farm"), position=Position(-97.7, 30.0))


def test_the_station_and_its_position_are_read_from_the_command_line() -> None:
    placed = read_settings(
        [*ARGUMENTS, "--placed-at", "farm", "--position", "-97.7", "30.0"], {}
    ).placed

    assert placed == AT_FARM
    assert read_settings(ARGUMENTS, {}).placed is None


def test_station_and_position_are_only_accepted_together() -> None:
    with pytest.raises(InvalidSettings, match="belong together"):
        read_settings([*ARGUMENTS, "--placed-at", "farm"], {})


def test_a_position_beyond_the_pole_is_refused() -> None:
    with pytest.raises(InvalidInput, match="90"):
        read_settings([*ARGUMENTS, "--placed-at", "farm", "--position", "0", "91"], {})


def test_a_drone_that_was_down_stands_there_empty_and_without_a_mission(
    drone: Any, steps: Any, tmp_path: Path
) -> None:
    packages = steps().pick_up("home", p1=1.0).made[0].packages
    down = drone.at_first().model_copy(
        update={"station_id": None, "is_down": True, "packages": packages}
    )
    with JournalFolder(tmp_path, [drone.drone_id]) as folder:
        folder.journal_of(drone.drone_id).compact(down)
        with (tmp_path / f"{drone.drone_id}.jsonl").open("a") as torn:
            torn.write('{"kind": "STEP", "st')

        place([drone], folder, AT_FARM)

        logbook = folder.journal_of(drone.drone_id).read(at_first=drone.at_first())
    assert (logbook.station_id, logbook.position) == ("farm", AT_FARM.position)
    assert (logbook.is_down, logbook.packages) == (False, ())


def test_a_drone_that_is_not_down_cannot_be_placed(drone: Any, tmp_path: Path) -> None:
    with (
        JournalFolder(tmp_path, [drone.drone_id]) as folder,
        pytest.raises(NotDown, match="drn_1 is not down"),
    ):
        place([drone], folder, AT_FARM)


def test_only_one_drone_can_be_placed(drone: Any, tmp_path: Path) -> None:
    with (
        JournalFolder(tmp_path, [drone.drone_id]) as folder,
        pytest.raises(InvalidSettings, match="one drone, and there are 2"),
    ):
        place([drone, drone], folder, AT_FARM)
