"""The example and the picture of docs/dispatch.md are right, and the page names every field."""

import re
import runpy
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from skyway.cli.dispatch import dispatch_command
from skyway.dispatch.problem import CurrentTrip, FleetDrone, FleetProblem, FleetRequest, Prices

APP = typer.Typer()
APP.command()(dispatch_command)

FOLDER = Path(__file__).parents[2] / "docs"
PAGE = (FOLDER / "dispatch.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)
    assert found is not None
    return found[1]


def test_the_command_prints_what_the_page_shows(tmp_path: Path) -> None:
    problem = tmp_path / "fleet.json"
    problem.write_text(block("json"), encoding="utf-8")

    result = CliRunner().invoke(APP, [str(problem), "--rounds", "5", "--bound"])

    assert result.exit_code == 0
    assert result.stdout == block("text")


def test_the_lines_of_python_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "fleet.json").write_text(block("json"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)

    exec(block("python").replace("budget_s=10.0", "rounds=5"), {})

    assert "r3" in capsys.readouterr().out


def test_the_picture_is_drawn(tmp_path: Path) -> None:
    script = runpy.run_path(str(FOLDER / "dispatch_picture.py"))

    plan = script["main"](tmp_path)

    assert plan.costs.served == 5
    assert (tmp_path / "dispatch.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("model", [FleetProblem, FleetDrone, FleetRequest, CurrentTrip, Prices])
def test_the_page_names_every_field(model: type[FleetProblem]) -> None:
    for name in model.model_fields:
        assert f"`{name}`" in PAGE or f"[].{name}`" in PAGE
