"""The commands in the README work when a user pastes them."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytestmark = [pytest.mark.end_to_end, pytest.mark.storage_pair("embedded")]

README = (Path(__file__).parents[2] / "README.md").read_text()


def test_the_four_commands_in_the_readme_complete_a_delivery(system: Any) -> None:
    (pasted,) = re.findall(r"```sh\n(make up\n.*?)```", README, re.DOTALL)
    commands = pasted.removeprefix("make up\n").replace(".venv/bin/skyway", "skyway")
    environment = system.environment | {"PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin"}

    done = subprocess.run(
        ["bash", "-c", f"set -e\n{commands}\nkill %1"],
        cwd=system.folder.path.parent,
        env=environment | {"SKYWAY_DATA": str(system.folder.path)},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )

    assert done.returncode == 0, done.stderr
    assert "COMPLETED" in done.stdout.splitlines()[-1]
    assert all(line[:1] != "{" for line in done.stderr.splitlines()), done.stderr


@pytest.mark.long
def test_the_commands_in_the_readme_complete_a_delivery(system: Any) -> None:
    (pasted,) = re.findall(r"```bash\n(.*?)```", README, re.DOTALL)
    folder = system.folder.path.parent
    (folder / ".skyway").symlink_to(system.folder.path)
    environment = system.environment | {"PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin"}
    curl = shutil.which("curl", path=environment["PATH"])
    if curl is None:
        pytest.skip("curl is not installed")

    done = subprocess.run(
        ["bash", "-c", f"set -e\n{pasted}\nkill %1"],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )

    assert done.returncode == 0, done.stderr
    events = [json.loads(line[6:]) for line in done.stdout.splitlines() if line[:6] == "data: "]
    assert events[-1]["type"] == "delivery.completed", done.stdout
    attempts = json.loads(done.stdout.splitlines()[-1])
    assert attempts["items"], done.stdout
