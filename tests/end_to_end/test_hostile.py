"""A short run of the hostile benchmark: rogues call and publish, and honest people go on."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.end_to_end.eventually import LONGEST_PROGRAM_S

ROOT = Path(__file__).parents[2]


@pytest.mark.end_to_end
@pytest.mark.parametrize(
    "storage", ["embedded", pytest.param("production", marks=pytest.mark.integration)]
)
@pytest.mark.long
def test_rogues_break_nothing_and_honest_people_go_on(storage: str) -> None:
    command = [
        sys.executable,
        "-m",
        "skyway_lab.benchmarks.hostile",
        f"--storage={storage}",
        "--seed=3",
    ]

    run = subprocess.run(
        # Other tests take the processor meanwhile: only a standstill counts as slower.
        [*command, "--minutes=0.15", "--drones=12", "--clock-rate=900", "--most-times=1000"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=LONGEST_PROGRAM_S,
        check=False,
    )

    assert run.returncode == 0, run.stdout + run.stderr
    assert "\n0 flaws\n" in run.stdout
