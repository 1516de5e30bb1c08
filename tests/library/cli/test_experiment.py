"""`skyway experiment`: its parts and its files."""

import pytest
from skyway_lab.experiments.page import PARTS, QUICK_S
from typer.testing import CliRunner

from skyway.cli.main import make_app


def test_an_unknown_part_is_refused():
    result = CliRunner().invoke(make_app(), ["experiment", "--only", "nothing"])

    assert result.exit_code == 2
    assert "'nothing' is not a part" in result.stderr


def test_without_the_lab_the_command_says_where_it_is(monkeypatch):
    monkeypatch.setattr("skyway.cli.experiment.find_spec", lambda _: None)

    result = CliRunner().invoke(make_app(), ["experiment"])

    assert result.exit_code == 1
    assert "pip install ./lab" in result.stderr


def test_a_quick_run_of_all_parts_takes_at_most_90_s_of_processor_time():
    assert QUICK_S.keys() == PARTS.keys()
    assert sum(QUICK_S.values()) <= 90


@pytest.mark.long
def test_one_part_alone_writes_its_page_figures_and_rows(tmp_path):
    arguments = ["experiment", "--quick", "--only", "recharging", "--out", str(tmp_path)]

    result = CliRunner().invoke(make_app(), arguments)

    assert result.exit_code == 0
    assert f"recharging: about {QUICK_S['recharging']} s on one core" in result.stderr
    assert "saved by partial" in result.stdout
    written = {path.name for path in (tmp_path / "experiments").iterdir()}
    assert {"recharging.csv", "recharging.md", "recharging.png"} <= written
    assert "# Experiments" in (tmp_path / "experiments.md").read_text(encoding="utf-8")
