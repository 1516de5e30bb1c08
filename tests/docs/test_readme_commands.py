"""README.md: the commands of its shortest path exist, with their options."""

import re
from pathlib import Path

import pytest
import typer
from typer.core import TyperGroup

from skyway.cli.main import make_app

README = (Path(__file__).parents[2] / "README.md").read_text()
SHORTEST_PATH = re.findall(r"^\.venv/bin/skyway (.+?)(?: &)?$", README, re.MULTILINE)


def test_the_shortest_path_has_four_commands() -> None:
    assert len(SHORTEST_PATH) == 3
    assert "```sh\nmake up\n.venv/bin/skyway" in README


@pytest.mark.parametrize("line", SHORTEST_PATH)
def test_a_command_of_the_shortest_path_can_be_parsed(line: str) -> None:
    command, arguments = typer.main.get_command(make_app()), line.split()
    while isinstance(command, TyperGroup):
        _, found, arguments = command.resolve_command(typer.Context(command), arguments)
        assert found is not None
        command = found

    command.make_context(command.name, list(arguments))
