"""`python -m skyway_lab` lists what it can run."""

import pytest
from skyway_lab.__main__ import NAMES, main


def test_the_list_says_what_each_benchmark_measures(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0

    listed = dict(
        line.strip().split(maxsplit=1)
        for line in capsys.readouterr().out.splitlines()
        if line.startswith("  ")
    )
    assert sorted(listed) == NAMES


def test_an_unknown_benchmark_is_refused_with_the_list(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["nothing"]) == 2

    assert ", ".join(NAMES) in capsys.readouterr().out
