"""The files in examples/ run, stay short, and are linked from a page."""

import json
import runpy
import shutil
from pathlib import Path
from typing import Any

import pytest

from tests.docs.test_planner_problem import PROBLEM

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
NOTEBOOK = EXAMPLES / "plan_and_figures.ipynb"


@pytest.mark.parametrize(
    ("script", "printed"),
    [("networkx_graph.py", "optimal after 846 s"), ("osm_graph.py", "optimal after 100 s")],
)
def test_a_graph_is_planned_on(
    script: str, printed: str, capsys: pytest.CaptureFixture[str]
) -> None:
    runpy.run_path(str(EXAMPLES / script), run_name="__main__")

    assert capsys.readouterr().out.startswith(printed)


def test_the_problem_is_the_one_on_the_page() -> None:
    assert json.loads((EXAMPLES / "problem.json").read_text()) == PROBLEM


@pytest.mark.long
def test_the_notebook_draws_a_plan_and_both_figures_of_the_paper(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("Agg")
    monkeypatch.setattr(pyplot, "show", pyplot.close)
    shutil.copy(EXAMPLES / "problem.json", tmp_path)
    monkeypatch.chdir(tmp_path)

    names: dict[str, Any] = {}
    for cell in json.loads(NOTEBOOK.read_text())["cells"]:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)

    assert capsys.readouterr().out.startswith("optimal 3211.15")
    for name in ("execution", "delivery"):
        assert (tmp_path / f"paper-{name}-time.png").read_bytes().startswith(b"\x89PNG")


def test_an_example_has_less_than_60_lines_and_a_link() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)

    for file in EXAMPLES.iterdir():
        if file.is_file():
            assert len(file.read_text(encoding="utf-8").splitlines()) < 60, file
            assert f"examples/{file.name}" in text
