"""A data folder is used by one process at a time."""

from pathlib import Path

import pytest

from skyway.cli.data_folder import DataFolder, held
from skyway.cli.demo.command import demo_command
from skyway.errors import SkywayError


@pytest.fixture
def folder(tmp_path: Path) -> DataFolder:
    made = DataFolder(tmp_path / "demo")
    made.make()
    return made


def test_a_folder_is_locked_by_one_process_at_a_time(folder: DataFolder) -> None:
    with held(folder), pytest.raises(SkywayError, match="another Skyway runs"), held(folder):
        pass

    with held(folder):
        pass


def test_a_demo_leaves_the_folder_of_a_running_one_alone(folder: DataFolder) -> None:
    database = folder.path / "gateway.db"
    database.touch()

    with held(folder), pytest.raises(SkywayError, match="another Skyway runs"):
        demo_command(data=folder.path.parent)

    assert database.exists()
