"""The small world of `skyway up`: an operator starts it, it ends at Ctrl-C and goes on later."""

import os
import signal
import subprocess
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import pytest

from skyway.cli.data_folder import DataFolder
from tests.end_to_end.eventually import LONGEST_WAIT_S, eventually
from tests.end_to_end.local_system import SKYWAY, LocalSystem
from tests.end_to_end.test_demo import processes_using

pytestmark = [pytest.mark.end_to_end, pytest.mark.long]


@pytest.fixture
def world(tmp_path: Path) -> Iterator[LocalSystem]:
    """The data folder of a small world that is not started, on the embedded pair."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("SKYWAY_")}
    local = LocalSystem(DataFolder(tmp_path / "data"), environment)
    local.folder.make()
    yield local
    local.stop()


def start(world: LocalSystem, *options: str, until: str) -> Path:
    """Start `skyway up` with these options, and wait until it says `until`; its output."""
    log = world.folder.path / "up.log"
    ports = ("--port", "0", "--mqtt-port", "0", "--rate", "300")
    command = [*SKYWAY, "up", *options, "--data", str(world.folder.path), *ports]
    with log.open("wb") as output:
        world.up = subprocess.Popen(command, stdout=output, stderr=output, env=world.environment)
    eventually(lambda: until in log.read_text(), "a start", instead=log.read_text)
    return log


def interrupt(world: LocalSystem) -> str:
    assert world.up is not None
    world.up.send_signal(signal.SIGINT)
    world.up.wait(LONGEST_WAIT_S)
    return (world.folder.path / "up.log").read_text()


#: What the story of the day says when something begins, and when it ends.
STORY = {
    "is closed until": "is open again",
    "people look at a propeller": "flies on",
    "gusts of 17 m/s": "the air is calm again",
}


def is_said(log: Path, text: str) -> bool:
    return text in log.read_text()


def deliveries(world: LocalSystem, state: str = "") -> set[str]:
    query = f"&state={state}" if state else ""
    items = world.operate("GET", f"/v1/deliveries?limit=200{query}")["items"]
    return {each["delivery_id"] for each in items}


def fleets(world: LocalSystem) -> dict[str, Any]:
    providers = [each["provider_id"] for each in world.operate("GET", "/v1/providers")["items"]]
    return {
        each: [
            drone["drone_id"]
            for drone in world.operate("GET", f"/v1/providers/{each}/drones")["items"]
        ]
        for each in providers
    }


def test_an_operator_starts_the_small_world_and_it_goes_on_after_a_restart(
    world: LocalSystem,
) -> None:
    log_in_by_the_printed_link(world, start(world, until="Stop: Ctrl-C"))
    assert world.operate("GET", "/v1/system")["small_world"] == "AVAILABLE"
    for _ in range(2):
        assert world.operate("POST", "/v1/small-world") == {"small_world": "REQUESTED"}
    eventually(lambda: deliveries(world, "COMPLETED"), "a completed delivery")
    lived = fleets(world)
    assert sum(len(drones) for drones in lived.values()) == 18

    assert "has stopped" in interrupt(world)
    assert processes_using(world.folder.path) == []

    log = start(world, "--demo", until="The small world")
    assert world.operate("GET", "/v1/system")["small_world"] == "REQUESTED"
    before = deliveries(world)
    eventually(lambda: deliveries(world, "COMPLETED") - before, "a delivery of the second start")
    assert fleets(world) == lived

    for begins, ends in STORY.items():
        eventually(partial(is_said, log, ends), ends, instead=log.read_text)
        assert is_said(log, begins)
    held = [each["is_held"] for each in world.operate("GET", "/v1/missions?state=ACTIVE")["items"]]
    assert held.count(True) <= 1
    names = {each["reference"] for each in world.operate("GET", "/v1/deliveries")["items"]}
    assert all(name.startswith("Order ") for name in names)


def log_in_by_the_printed_link(world: LocalSystem, log: Path) -> None:
    [line] = [each for each in log.read_text().splitlines() if "#login=" in each]
    address, _, code = line.split()[1].partition("/console#login=")
    begun = httpx.post(f"{address}/v1/sessions", json={"code": code}, headers={"Origin": address})
    assert begun.json()["role"] == "operator"
    for role in ("operator", "customer"):
        printed = world.command("console", "--role", role)
        assert printed.stdout.startswith(f"{address}/console#login="), printed.stderr
