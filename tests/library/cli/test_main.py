"""Wrong input of `skyway` is answered with a sentence that names it, without a traceback."""

import json
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import pytest
import typer
from typer.core import TyperGroup

from skyway.cli.main import main, make_app

#: What a help text may import besides the standard library, and which parts of the library.
#: `__mp_main__` is a name that multiprocessing gives to the main module.
MAY_IMPORT = {"__mp_main__", "annotated_doc", "shellingham", "typer"}
MAY_IMPORT_OF_SKYWAY = {"skyway.errors", "skyway.json_text", "skyway.units", "skyway.workers"} | {
    *("skyway.runtime", "skyway.runtime.errors", "skyway.runtime.metrics"),
    *("skyway.broker_setup", "skyway.broker_setup.private_file"),
}
#: Prints, as JSON, the new modules of each help text in one fresh process.
HELP = """
import contextlib, io, json, sys
before = set(sys.modules)
from skyway.cli.main import main
def help(*command):
    sys.argv = ["skyway", *command, "--help"]
    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        main()
    new = set(sys.modules) - before
    before.update(new)
    return sorted(new - sys.stdlib_module_names)
print(json.dumps({" ".join(command): help(*command) for command in json.loads(sys.argv[1])}))
"""


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


def commands_below(command: object, *names: str) -> list[tuple[str, ...]]:
    """The command line of each command, of the whole one first."""
    found = [names]
    if isinstance(command, TyperGroup):
        context = typer.Context(command)
        for name in command.commands:
            called, below, _ = command.resolve_command(context, [name])
            found += commands_below(below, *names, str(called))
    return found


def test_a_help_text_imports_only_what_is_listed_here() -> None:
    commands = commands_below(typer.main.get_command(make_app()))
    code = [sys.executable, "-c", HELP, json.dumps(commands)]
    ended = subprocess.run(code, capture_output=True, text=True, check=True, timeout=60)

    def is_allowed(module: str) -> bool:
        top, _, below = module.partition(".")
        if top == "skyway":
            return not below or below.startswith("cli") or module in MAY_IMPORT_OF_SKYWAY
        return top in MAY_IMPORT or top in sys.stdlib_module_names

    found = json.loads(ended.stdout)
    heavy = {
        command: [each for each in new if not is_allowed(each)] for command, new in found.items()
    }
    assert len(found) > 50
    assert {command: modules for command, modules in heavy.items() if modules} == {}


def test_the_list_of_commands_has_the_first_line_of_each_help() -> None:
    group = typer.main.get_group(make_app())

    listed = {name: command.short_help for name, command in group.commands.items()}

    context = typer.Context(group)
    loaded = {name: group.resolve_command(context, [name])[1] for name in listed}
    helps = {name: str(command and command.help) for name, command in loaded.items()}
    assert listed == {name: text.partition("\n")[0] for name, text in helps.items()}
