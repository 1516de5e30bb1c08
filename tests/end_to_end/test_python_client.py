"""The Python client is built as its users build it, and plays a shop's day."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.long,
    pytest.mark.storage_pair("embedded"),
]

ROOT = Path(__file__).parents[2]
STORIES = Path(__file__).parent / "client_stories"
BIN = Path(sys.executable).parent


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that holds the built package `skyway_client`."""
    folder = tmp_path_factory.mktemp("client")
    run(BIN / "hatchling", "build", "-t", "wheel", "-d", folder, cwd=ROOT / "clients" / "python")
    [wheel] = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as packed:
        packed.extractall(folder / "installed")
    return folder / "installed"


def run(*command: object, cwd: Path, **environment: str) -> str:
    """What a command prints. It must succeed."""
    done = subprocess.run(
        [str(word) for word in command],
        env=os.environ | environment,
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


# These tests need no system. With the fixture, one worker runs all tests and builds one client.
@pytest.mark.usefixtures("running_system")
def test_the_stories_are_typed_by_the_python_client(client: Path) -> None:
    # What mypy finds in libraries stays for the next run.
    cache = f"--cache-dir={ROOT / '.mypy_cache/python_client'}"
    options = ("--strict", "--follow-imports=silent", "--config-file=", cache)

    run(BIN / "mypy", *options, *STORIES.glob("*.py"), cwd=client, MYPYPATH=str(client))


@pytest.mark.usefixtures("running_system")
def test_the_python_client_repeats_only_what_does_nothing_twice(client: Path) -> None:
    story = STORIES / "unlucky_hour.py"

    assert run(sys.executable, story, cwd=client, PYTHONPATH=str(client)) == "GOOD\n"


def test_a_shop_orders_follows_and_verifies_with_the_python_client(
    client: Path, system: Any, tmp_path: Path
) -> None:
    system.publish_corridor("shop")
    system.start_fleet(["shop-s1", "shop-s2"])
    url, key = (system.keys[f"SKYWAY_{name}"] for name in ("GATEWAY_URL", "CUSTOMER_KEY"))

    printed = run(
        *(sys.executable, STORIES / "story.py", url, key, "shop-s1", "shop-s3"),
        cwd=tmp_path,
        PYTHONPATH=str(client),
    )

    assert printed.splitlines()[-1] == "COMPLETED"


def test_a_shop_plays_its_day_with_a_test_key(client: Path, system: Any, tmp_path: Path) -> None:
    """No network is published, and no drone flies."""
    url, key = (system.keys[f"SKYWAY_{name}"] for name in ("GATEWAY_URL", "CUSTOMER_KEY"))
    made = system.call("POST", "/v1/keys", key=key, body={"livemode": False}).json()

    printed = run(
        *(sys.executable, STORIES / "story.py", url, made["key"], "harbour", "library"),
        cwd=tmp_path,
        PYTHONPATH=str(client),
    )

    assert printed.splitlines()[-1] == "COMPLETED"
