"""A client that a customer generates from the public document plays the README's story."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.end_to_end.corridor_network import corridor
from tests.end_to_end.local_system import SKYWAY

pytestmark = [pytest.mark.end_to_end, pytest.mark.storage_pair("embedded")]

ROOT = Path(__file__).parents[2]
STORY = Path(__file__).parent / "generated_client" / "story.py"
BIN = Path(sys.executable).parent


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that holds the generated package `skyway_client`."""
    folder = tmp_path_factory.mktemp("client")
    config = folder / "config.yaml"
    config.write_text("post_hooks: []\nproject_name_override: skyway-client\n")
    done = subprocess.run(
        [
            BIN / "openapi-python-client",
            "generate",
            "--fail-on-warning",
            f"--path={ROOT / 'openapi' / 'gateway.json'}",
            f"--config={config}",
            f"--output-path={folder / 'made'}",
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "made"


# This test needs no system. With the fixture, one worker runs both tests and generates one client.
@pytest.mark.usefixtures("running_system")
def test_the_story_is_typed_by_the_generated_client(client: Path) -> None:
    # What mypy finds in libraries stays for the next run.
    cache = f"--cache-dir={ROOT / '.mypy_cache/generated_client'}"
    done = subprocess.run(
        [BIN / "mypy", "--strict", "--follow-imports=silent", "--config-file=", cache, str(STORY)],
        env=os.environ | {"MYPYPATH": str(client)},
        cwd=client,
        capture_output=True,
        text=True,
        check=False,
    )

    assert done.returncode == 0, done.stdout


@pytest.mark.long
def test_the_generated_client_plays_the_story_of_the_readme(
    client: Path, system: Any, tmp_path: Path
) -> None:
    network = tmp_path / "network.json"
    network.write_text(json.dumps(corridor("story")))
    keys = system.keys
    fleet = (*SKYWAY, "fleet", "--data", str(system.folder.path))

    done = subprocess.run(
        [
            sys.executable,
            STORY,
            keys["SKYWAY_GATEWAY_URL"],
            keys["SKYWAY_OPERATOR_KEY"],
            network,
            *fleet,
        ],
        env=system.environment | {"PYTHONPATH": str(client)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )

    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1] == "COMPLETED"
