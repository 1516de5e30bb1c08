"""Every block of code of the pages runs as printed, or is marked as a fragment.

A block is run by the tests that `RUN_BY` names. All others have the word `fragment` after their
language; their `skyway` commands are still parsed. Mermaid's blocks are pictures.
"""

import json
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
import typer
from typer.core import TyperGroup

from skyway.cli.main import make_app
from skyway.contracts.weather import ForecastDocument

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^( *)```(\w*)([^\n]*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)

#: The tests that run the blocks of a page which are no fragments, one for each block in order.
README_STORY = "tests/end_to_end/test_readme.py"
DISPATCH = "tests/docs/test_dispatch.py"
HERE = "tests/docs/test_blocks.py"
RUN_BY = {
    "README.md": [README_STORY, README_STORY, HERE],
    "docs/dispatch.md": [DISPATCH, DISPATCH, DISPATCH],
    "docs/kubernetes.md": ["tests/chart/chart_cases.py", "tests/chart/test_secrets_page.py"],
    "docs/live.md": [HERE],
    "docs/reference/drone-protocol.md": ["tests/docs/test_drone_protocol.py"] * 5,
    "docs/reference/planner-problem.md": ["tests/docs/test_planner_problem.py"] * 2,
    "docs/reference/planner-trips.md": [HERE],
    "docs/reference/webhooks.md": ["tests/docs/test_webhooks.py"] * 3,
    "docs/weather.md": [HERE, HERE],
}


class Block(NamedTuple):
    """A block of code: its page, its language, whether it is a fragment, and its lines."""

    page: str
    language: str
    is_fragment: bool
    text: str


def blocks() -> Iterator[Block]:
    for page in PAGES:
        for _, language, more, text in BLOCK.findall(page.read_text(encoding="utf-8")):
            name = page.relative_to(ROOT).as_posix()
            if language != "mermaid":
                yield Block(name, language, more == " fragment", text)


BLOCKS = list(blocks())


def run_blocks(page: str, language: str) -> list[str]:
    """The blocks of a page in a language that are no fragments."""
    asked = (page, language, False)
    return [text for *found, text in BLOCKS if tuple(found) == asked]


def parse(arguments: list[str]) -> None:
    """Parse as the command line would, without running; an unknown name or option raises."""
    command = typer.main.get_command(make_app())
    while isinstance(command, TyperGroup):
        _, found, arguments = command.resolve_command(typer.Context(command), arguments)
        assert found is not None
        command = found
    command.make_context(command.name, list(arguments))


def commands_in(block: Block) -> Iterator[list[str]]:
    """The arguments of each `skyway` command in a block of shell."""
    for line in block.text.replace("\\\n", " ").splitlines():
        if found := re.match(r"\s*(?:\.venv/bin/)?skyway ([^>&|]*)", line):
            yield shlex.split(found[1], comments=True)


def test_every_block_is_run_by_a_test_or_marked_as_a_fragment() -> None:
    run = {page: [each for each in BLOCKS if each.page == page] for page in RUN_BY}
    unmarked = [each for each in BLOCKS if not each.is_fragment]

    assert {each.page for each in unmarked} == set(RUN_BY)
    assert all(each.language for each in BLOCKS)
    for page, tests in RUN_BY.items():
        assert len([each for each in run[page] if not each.is_fragment]) == len(tests), page
        assert all(Path(page).name in (ROOT / test).read_text() for test in tests), page


def test_every_command_in_a_block_can_be_parsed() -> None:
    commands = [each for block in BLOCKS for each in commands_in(block)]

    assert len(commands) > 20
    for arguments in commands:
        parse(arguments)


def test_every_block_of_json_is_json() -> None:
    for block in BLOCKS:
        if block.language == "json":
            text = block.text if block.text.lstrip()[0] in "{[" else f"{{{block.text}}}"
            json.loads(text)


@pytest.mark.parametrize("page", ["README.md", "docs/reference/planner-trips.md"])
def test_a_block_of_python_runs_in_the_folder_of_the_project(
    page: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    (text,) = run_blocks(page, "python")

    names: dict[str, object] = {}
    exec(text, names)

    assert names["plan"]


def test_a_forecast_on_the_page_is_one() -> None:
    for text in run_blocks("docs/weather.md", "json"):
        ForecastDocument.model_validate_json(text)


def test_the_patches_of_the_live_picture_merge_as_rfc_7396_says() -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    (merge,) = run_blocks("docs/live.md", "js")
    target = {"drones": {"a": {"soc": 1.0, "at": [1, 2]}, "b": {"soc": 0.5}}}
    patch = {"drones": {"a": {"soc": 0.9, "at": [3]}, "b": None, "c": {"soc": 0.1}}}

    call = f"console.log(JSON.stringify(merge({json.dumps(target)}, {json.dumps(patch)})))"
    done = subprocess.run(
        [node, "-e", f"{merge}\n{call}"], capture_output=True, text=True, timeout=60, check=True
    )

    merged = {"drones": {"a": {"soc": 0.9, "at": [3]}, "c": {"soc": 0.1}}}
    assert json.loads(done.stdout) == merged
