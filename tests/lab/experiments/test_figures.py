import sys

import pytest
from skyway_lab.experiments.figures import (
    Axis,
    Line,
    NoMatplotlib,
    Stack,
    draw_lines,
    draw_stacks,
    require_matplotlib,
)
from skyway_lab.experiments.sample import Estimate

X, Y = Axis("stations"), Axis("s", "log")


def test_without_matplotlib_the_message_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)

    with pytest.raises(NoMatplotlib, match="pip install matplotlib"):
        require_matplotlib()


def test_the_same_results_make_the_same_file(tmp_path):
    known, censored = Estimate(1.0, 0.5, 2.0), Estimate(10.0, 9.0, float("inf"), is_at_least=True)
    lines = [Line("exhaustive", [10, 20], [known, censored])]

    for name in ("one.png", "other.png"):
        draw_lines(tmp_path / name, "Times", x=X, y=Y, lines=lines)

    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "other.png").read_bytes()


def test_a_run_that_reached_its_limit_changes_the_figure(tmp_path):
    known, censored = Estimate(10.0, 9.0, 11.0), Estimate(10.0, 9.0, 11.0, is_at_least=True)
    drawn = {
        "plain": Line("exhaustive", [10], [known]),
        "limited": Line("exhaustive", [10], [known], [True]),
        "at least": Line("exhaustive", [10], [censored]),
    }

    for name, line in drawn.items():
        draw_lines(tmp_path / f"{name}.png", "Times", x=X, y=Y, lines=[line])

    assert len({(tmp_path / f"{name}.png").read_bytes() for name in drawn}) == 3


def test_infinite_values_are_not_drawn(tmp_path):
    never = Estimate(float("inf"), 1.0, float("inf"), is_at_least=True)

    draw_lines(tmp_path / "never.png", "Never", x=X, y=Y, lines=[Line("who", [1], [never])])

    assert (tmp_path / "never.png").exists()


def test_parts_below_zero_are_stacked_downwards(tmp_path):
    stacks = [Stack("gain", [2.0, -1.0]), Stack("loss", [-1.0, 3.0])]

    draw_stacks(tmp_path / "bars.png", "Bars", x=X, y=Axis("%"), bars=["a", "b"], stacks=stacks)

    assert (tmp_path / "bars.png").read_bytes().startswith(b"\x89PNG")
