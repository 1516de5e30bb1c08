"""Wrong input of `skyway` is answered with a sentence that names it, without a traceback."""

import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import pytest

from skyway.cli.main import main


class Ended(NamedTuple):
    returncode: int | str | None
    stdout: str
    stderr: str


Skyway = Callable[..., Ended]


@pytest.fixture
def skyway(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Skyway:
    """The command as the shell calls it, but in this process: starting one takes a second."""

    def run(*arguments: object) -> Ended:
        monkeypatch.setattr(sys, "argv", ["skyway", *(str(argument) for argument in arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return Ended(ended.value.code, *capsys.readouterr())

    return run


@pytest.mark.parametrize("command", ["up", "demo", "secrets"])
def test_a_data_folder_that_is_a_file_is_named(
    skyway: Skyway, command: str, tmp_path: Path
) -> None:
    file = tmp_path / "file"
    file.touch()

    ended = skyway(command, "--data", file)

    assert ended.returncode == 1
    assert ended.stderr.startswith(f"skyway: {file}")


def test_a_missing_request_file_is_named(skyway: Skyway, tmp_path: Path) -> None:
    ended = skyway("request", "--file", tmp_path / "nofile", "--data", tmp_path)

    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr == f"skyway: {tmp_path / 'nofile'}: No such file or directory\n"


def test_the_version_is_printed(skyway: Skyway) -> None:
    ended = skyway("--version")

    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout == f"skyway {version('skyway')}\n"


def test_verify_of_an_empty_folder_names_the_database_and_makes_none(
    skyway: Skyway, tmp_path: Path
) -> None:
    ended = skyway("verify", "--data", tmp_path)

    assert ended.returncode == 1
    assert f"there is no database {tmp_path / 'registry.db'}" in ended.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", ["[]", "[1]", '{"items": []}', '{"items": 3}', "7", '{"a": 1}'])
def test_a_fleet_file_without_drones_is_named(skyway: Skyway, content: str, tmp_path: Path) -> None:
    file = tmp_path / "fleet.json"
    file.write_text(content)

    ended = skyway("fleet", file, "--data", tmp_path)

    assert ended.returncode == 1
    assert ended.stderr == f"{file} is not the answer of POST /v1/providers/{{id}}/drones\n"


def test_a_network_is_published_with_the_keys_of_a_data_folder(
    skyway: Skyway, tmp_path: Path
) -> None:
    ended = skyway("network", "import", "bundled", "--network-id", "texas", "--data", tmp_path)

    assert ended.returncode == 1
    assert str(tmp_path / "keys.env") in ended.stderr
