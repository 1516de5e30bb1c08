"""Flaws that the services themselves show: their answers, and what `skyway verify` finds."""

import os
import subprocess
import sys
from collections.abc import Iterator

from skyway_lab.benchmarks.chaos.customers import Requests
from skyway_lab.benchmarks.chaos.judgement import Flaw

from skyway.cli.data_folder import DataFolder


def answer_flaws(requests: Requests) -> Iterator[Flaw]:
    """Answers that no customer should get."""
    for (answer, fault), count in sorted(requests.answers.items()):
        # A process without memory cannot even know what it lacks.
        if answer == "500" and not fault.startswith("no memory"):
            yield Flaw("answer 500", None, f"{count} POSTs were answered 500; {fault}")
    for seen in requests.unanswered:
        yield Flaw("unanswered", None, seen)


def verify_flaws(folder: DataFolder) -> list[Flaw]:
    """What `skyway verify` finds in the databases as they stand."""
    command = [sys.executable, "-m", "skyway.cli", "verify", "--data", str(folder.path)]
    checked = subprocess.run(
        command, capture_output=True, text=True, check=False, env=dict(os.environ)
    )
    if checked.returncode == 0:
        return []
    lines = (checked.stdout + checked.stderr).strip().splitlines()
    return [Flaw("verify", None, line) for line in lines]
