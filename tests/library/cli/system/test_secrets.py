"""The secrets of a local system: made once, unique, and readable by their user only."""

from pathlib import Path

import pytest

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import read_keys
from skyway.cli.system.secrets import (
    make_database_passwords,
    make_secrets,
    read_secret,
    write_keys_file,
)


@pytest.fixture
def folder(tmp_path: Path) -> DataFolder:
    return DataFolder(tmp_path / "data")


def test_secrets_are_readable_by_their_user_alone(folder: DataFolder) -> None:
    make_secrets(folder)

    modes = {path.name: path.stat().st_mode & 0o777 for path in folder.secrets.iterdir()}
    assert len(modes) == 15
    assert set(modes.values()) == {0o600}


def test_secrets_are_made_once_and_kept(folder: DataFolder) -> None:
    make_secrets(folder)
    before = read_secret(folder, "operator_key")

    make_secrets(folder)

    assert read_secret(folder, "operator_key") == before


def test_no_two_secrets_are_the_same(folder: DataFolder) -> None:
    make_secrets(folder)

    contents = [path.read_text() for path in folder.secrets.iterdir()]
    assert len(set(contents)) == len(contents)


def test_keys_env_holds_what_the_command_line_reads(folder: DataFolder) -> None:
    make_secrets(folder)

    write_keys_file(folder, "http://127.0.0.1:8000", "mqtt://127.0.0.1:1883")

    keys = read_keys(folder)
    assert keys["SKYWAY_GATEWAY_URL"] == "http://127.0.0.1:8000"
    assert keys["SKYWAY_OPERATOR_KEY"] == read_secret(folder, "operator_key")
    assert keys["SKYWAY_METRICS_KEY"] == read_secret(folder, "metrics_key")
    assert folder.keys_file.stat().st_mode & 0o777 == 0o600


def test_a_service_s_passfile_holds_the_password_that_its_role_gets(
    folder: DataFolder, tmp_path: Path
) -> None:
    make_secrets(folder)

    make_database_passwords(folder, tmp_path / "server", host="postgres")

    password = (tmp_path / "server" / "gateway").read_text().strip()
    line = read_secret(folder, "pgpass_gateway")
    assert line == f"postgres:*:*:skyway_gateway:{password}"
