"""docs/texas_corridor.py, which uses the library alone, runs."""

import runpy
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "docs" / "texas_corridor.py"


def test_the_script_plans_and_draws_the_corridor(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    script = runpy.run_path(str(SCRIPT))

    plan = script["main"](tmp_path)

    assert plan.status == "optimal"
    assert capsys.readouterr().out.startswith("optimal: delivered after")
    assert (tmp_path / "texas_corridor.png").read_bytes().startswith(b"\x89PNG")
