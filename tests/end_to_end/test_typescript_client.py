"""The TypeScript client is built as its users build it, and plays a shop's day."""

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

CLIENT = Path(__file__).parents[2] / "clients" / "typescript"
STORY = Path(__file__).parent / "client_stories" / "story.ts"

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.long,
    pytest.mark.storage_pair("embedded"),
    pytest.mark.skipif(
        not (CLIENT / "node_modules").exists(),
        reason="run `npm install --no-package-lock` in clients/typescript, as .ci/run does",
    ),
]


@pytest.fixture(scope="module")
def story(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The compiled story, in the folder of a shop that has installed the client."""
    run("npm", "run", "build", cwd=CLIENT)
    folder = tmp_path_factory.mktemp("shop")
    packages = folder / "node_modules"
    (packages / "@skyway").mkdir(parents=True)
    (packages / "@skyway" / "client").symlink_to(CLIENT)
    (packages / "@types").symlink_to(CLIENT / "node_modules" / "@types")
    (folder / "package.json").write_text(json.dumps({"type": "module"}))
    (folder / "story.ts").write_text(STORY.read_text())
    options = ("--strict", "--skipLibCheck", "--module", "nodenext", "--target", "es2022")
    run(CLIENT / "node_modules" / ".bin" / "tsc", *options, "story.ts", cwd=folder)
    return folder / "story.js"


def run(*command: object, cwd: Path) -> str:
    """What a command prints. It must succeed."""
    done = subprocess.run(
        [str(word) for word in command],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_shop_orders_follows_and_verifies_with_the_typescript_client(
    story: Path, system: Any
) -> None:
    system.publish_corridor("tsshop")
    system.start_fleet(["tsshop-s1", "tsshop-s2"])
    url, key = (system.keys[f"SKYWAY_{name}"] for name in ("GATEWAY_URL", "CUSTOMER_KEY"))

    printed = run("node", story, url, key, "tsshop-s1", "tsshop-s3", cwd=story.parent)

    assert printed.splitlines()[-1] == "COMPLETED"


def test_a_shop_plays_its_day_with_a_test_key_in_typescript(story: Path, system: Any) -> None:
    """No network is published, and no drone flies."""
    url, key = (system.keys[f"SKYWAY_{name}"] for name in ("GATEWAY_URL", "CUSTOMER_KEY"))
    made = system.call("POST", "/v1/keys", key=key, body={"livemode": False}).json()

    printed = run("node", story, url, made["key"], "harbour", "library", cwd=story.parent)

    assert printed.splitlines()[-1] == "COMPLETED"
