"""Two agents never serve the same drone, and never disturb one another."""

from pathlib import Path

import pytest
from skyway_drone_agent.journal.journal_folder import DroneInUse, JournalFolder

from skyway.ids import DroneId

ONE, TWO, THREE = DroneId("drn_1"), DroneId("drn_2"), DroneId("drn_3")


def test_a_drone_in_use_is_refused_by_name(tmp_path: Path) -> None:
    with (
        JournalFolder(tmp_path / "agent", [ONE, TWO]),
        pytest.raises(DroneInUse, match="drn_2"),
    ):
        JournalFolder(tmp_path / "agent", [TWO, THREE]).__enter__()


def test_a_refused_process_holds_no_drone(tmp_path: Path) -> None:
    with JournalFolder(tmp_path, [TWO]), pytest.raises(DroneInUse):
        JournalFolder(tmp_path, [ONE, TWO]).__enter__()

    with JournalFolder(tmp_path, [ONE]):
        pass


def test_two_fleets_share_a_folder(tmp_path: Path) -> None:
    with JournalFolder(tmp_path, [ONE]), JournalFolder(tmp_path, [TWO]):
        pass


def test_a_drone_is_free_again_afterwards(tmp_path: Path) -> None:
    for _ in range(2):
        with JournalFolder(tmp_path, [ONE]) as folder:
            assert folder.clock_file.parent.is_dir()
