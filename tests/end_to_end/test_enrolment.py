"""A drone's credentials through every process: enrolled, rotated, revoked, enrolled again."""

import json
import signal
from pathlib import Path
from typing import Any

import pytest

from tests.end_to_end.drone_by_hand import path_of, register, run, until

pytestmark = [pytest.mark.end_to_end, pytest.mark.storage_pair("postgresql-mosquitto")]


@pytest.fixture
def drone(system: Any) -> dict[str, Any]:
    """A drone that is registered and has never connected."""
    system.publish_corridor("enrol")
    return register(system, "enrol-s1")


def revoke(system: Any, drone: dict[str, Any]) -> None:
    """Revoke the drone's credentials, and wait until it is cut off and the cloud knows."""
    log = system.folder.path / "drone.log"
    before = log.stat().st_size
    system.operate("DELETE", f"{path_of(drone)}/credentials")
    system.eventually(
        lambda: b"no connection to the broker" in log.read_bytes()[before:],
        "the end of the connection",
    )
    until(system, drone, "OFFLINE")


def stored_by(system: Any, drone: dict[str, Any]) -> dict[str, Any]:
    """The credentials that the agent has on disk."""
    [path] = Path(system.folder.journals).glob(f"{drone['drone_id']}.credentials.json")
    stored: dict[str, Any] = json.loads(path.read_text())["drone"]
    return stored


def test_a_drone_enrols_rotates_is_revoked_and_enrols_again(
    system: Any, drone: dict[str, Any]
) -> None:
    first = run(system, token=drone["enrolment_token"])
    until(system, drone, "AVAILABLE")
    enrolled = stored_by(system, drone)
    own = system.call("GET", path_of(drone), key=enrolled["key"])
    foreign = system.call("GET", "/v1/deliveries", key=enrolled["key"])
    used = system.call(
        "POST", "/v1/enrolments", key="none", body={"enrolment_token": drone["enrolment_token"]}
    )
    first.send_signal(signal.SIGTERM)
    first.wait(timeout=60)
    until(system, drone, "OFFLINE")

    second = run(system, "--rotate")
    until(system, drone, "AVAILABLE")
    rotated = stored_by(system, drone)
    old = system.call("GET", path_of(drone), key=enrolled["key"])
    revoke(system, drone)
    revoked = system.call("GET", path_of(drone), key=rotated["key"])
    made = system.operate("POST", f"{path_of(drone)}/enrolment-tokens")
    second.send_signal(signal.SIGTERM)
    second.wait(timeout=60)
    run(system, token=made["enrolment_token"])
    until(system, drone, "AVAILABLE")

    assert (own.status_code, foreign.status_code) == (200, 403)
    assert (used.status_code, used.json()["code"]) == (409, "TOKEN_USED")
    assert (old.status_code, revoked.status_code) == (401, 401)
    again = stored_by(system, drone)
    keys = {one["key"] for one in (enrolled, rotated, again)}
    passwords = {one["mqtt"]["password"] for one in (enrolled, rotated, again, drone)}
    assert (len(keys), len(passwords)) == (3, 4)
    secrets = keys | passwords | {drone["enrolment_token"], made["enrolment_token"]}
    folder = system.folder.path
    logs = [path for pattern in ("logs/*", "*.db*", "*.log") for path in folder.glob(pattern)]
    assert [p.name for p in logs for one in secrets if one.encode() in p.read_bytes()] == []
