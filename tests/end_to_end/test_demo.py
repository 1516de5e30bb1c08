"""`skyway demo`: the first command that a new user runs."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.end_to_end, pytest.mark.long]


def test_the_demo_delivers_three_packages_and_leaves_nothing_running(tmp_path: Path) -> None:
    environment = {k: v for k, v in os.environ.items() if not k.startswith("SKYWAY_")}

    done = subprocess.run(
        [sys.executable, "-m", "skyway.cli", "demo", "--data", str(tmp_path)],
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )

    assert done.returncode == 0, done.stdout + done.stderr
    for package in ("medicine", "camera", "books"):
        assert f"package.delivered {package}" in done.stdout
    assert "proven optimal: no plan delivers earlier" in done.stdout
    assert "BAD SIGNATURE" not in done.stdout
    shown = [
        done.stdout.find(each)
        for each in (
            "courier 2: san-marcos to new-braunfels: PLANNED behind 1",
            "courier 1: new-braunfels to san-marcos: COMPLETED",
            "courier 2: san-marcos to new-braunfels: COMPLETED",
        )
    ]
    assert -1 < shown[0] < shown[1] < shown[2]
    assert not processes_using(tmp_path)


def processes_using(folder: Path) -> list[str]:
    """Processes whose command line or environment names this folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            text = (process / "environ").read_bytes() + (process / "cmdline").read_bytes()
        except OSError:
            continue
        if str(folder).encode() in text:
            found.append(process.name)
    return found
