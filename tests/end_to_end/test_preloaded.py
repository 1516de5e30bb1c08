"""A copy of the preloaded process does what a process of the real command does."""

import os
import subprocess

import pytest

from tests.end_to_end.eventually import LONGEST_WAIT_S
from tests.end_to_end.local_system import SKYWAY
from tests.end_to_end.preloaded import run_preloaded

pytestmark = pytest.mark.end_to_end


@pytest.mark.parametrize("arguments", [("--help",), ("verify", "--data", "missing")])
def test_a_copy_prints_and_returns_what_the_real_command_does(arguments: tuple[str, ...]) -> None:
    command = [*SKYWAY, *arguments]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("SKYWAY_")}

    copy = run_preloaded(command, environment=environment, timeout_s=LONGEST_WAIT_S)
    real = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)

    seen = (copy.returncode, copy.stdout, copy.stderr)
    assert seen == (real.returncode, real.stdout, real.stderr)
