"""A short run of the chaos benchmark: parts fail one after another, and nothing is lost."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.end_to_end.eventually import LONGEST_PROGRAM_S

ROOT = Path(__file__).parents[2]
FAULTS = (
    "kill: everything",
    "kill: drones",
    "cut: gateway to composition",
    "poison: drones",
    "poison: another drone",
)


@pytest.mark.end_to_end
@pytest.mark.long
def test_nothing_is_lost_and_nothing_done_twice_while_parts_fail() -> None:
    options = [f"--only={fault}" for fault in FAULTS]
    command = [
        sys.executable,
        "-m",
        "skyway_lab.benchmarks.chaos",
        "--minutes=0.3",
        "--seed=2",
        *options,
    ]

    run = subprocess.run(
        [*command, "--drones=12", "--stations=20", "--agents=1", "--clock-rate=900"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=LONGEST_PROGRAM_S,
        check=False,
    )

    assert run.returncode == 0, run.stdout + run.stderr
    assert "\n0 flaws\n" in run.stdout
