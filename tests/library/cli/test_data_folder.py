"""A data folder is used by one process at a time, and keeps kernels where nothing else can."""

import os
from pathlib import Path

import pytest

from skyway.cli.data_folder import DataFolder, held, keep_kernels
from skyway.cli.demo.command import demo_command
from skyway.errors import SkywayError
from skyway.runtime.sql.server_url import read_url


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


@pytest.mark.parametrize("has_home", [True, False])
def test_kernels_are_kept_in_the_data_folder_where_nothing_else_can_be_written_to(
    folder: DataFolder,
    *,
    has_home: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file = tmp_path / "file"
    file.touch()  # not even root can write below a file
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")  # so that it is restored
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path if has_home else file))

    keep_kernels(folder, installed=file / "__pycache__")

    expected = None if has_home else str(folder.path / "kernels")
    assert os.environ.get("NUMBA_CACHE_DIR") == expected
    assert ("NUMBA_CACHE_DIR names another folder" in capsys.readouterr().err) is not has_home


@pytest.mark.parametrize("name", ["feature%2Fx", "a b", "a#b", "a?b=c", "50%", "ä"])
def test_any_name_of_a_data_folder_leads_to_its_own_database(tmp_path: Path, name: str) -> None:
    folder = DataFolder(tmp_path / name)
    folder.make()

    url = read_url(folder.database_url("registry"))

    assert url.database == str(tmp_path.resolve() / name / "registry.db")
    assert not url.query
