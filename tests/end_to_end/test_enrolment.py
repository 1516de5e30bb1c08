"""A drone's credentials through every process: got by a token, rotated, revoked, got again."""

import json
import signal
import time
from pathlib import Path
from typing import Any

import pytest
from lone_drone import path_of, register, run, until

pytestmark = pytest.mark.end_to_end

#: Wall seconds within which a revoked drone is cut off, and how many ordinary calls that is: where
#: so many take longer, the machine is too busy for anything within a second.
_AT_ONCE_S, _AT_ONCE_CALLS = 1.0, 20


@pytest.fixture
def drone(system: Any) -> dict[str, Any]:
    """A drone that is registered, and has never been heard of."""
    system.publish_corridor("enrol")
    return register(system, "enrol-s1")


def cut_off(system: Any, drone: dict[str, Any]) -> float:
    """Wall seconds between the answer to a revocation and the end of the drone's connection."""
    log = system.folder.path / "drone.log"
    before = log.stat().st_size
    system.operate("DELETE", f"{path_of(drone)}/credentials")
    since = time.monotonic()
    system.eventually(
        lambda: b"no connection to the broker" in log.read_bytes()[before:],
        "the end of the connection",
    )
    return time.monotonic() - since


def a_second(system: Any, drone: dict[str, Any]) -> float:
    """The wall seconds that a second on a quiet machine comes to on this one, now."""
    since = time.monotonic()
    for _ in range(5):
        system.operate("GET", path_of(drone))
    return max(_AT_ONCE_S, (time.monotonic() - since) / 5 * _AT_ONCE_CALLS)


def kept_by(system: Any, drone: dict[str, Any]) -> dict[str, Any]:
    """What the agent has on disk."""
    [path] = Path(system.folder.journals).glob(f"{drone['drone_id']}.credentials.json")
    kept: dict[str, Any] = json.loads(path.read_text())["drone"]
    return kept


def test_a_drone_enrols_rotates_is_revoked_and_enrols_again(
    system: Any, drone: dict[str, Any]
) -> None:
    first = run(system, token=drone["enrolment_token"])
    until(system, drone, "AVAILABLE")
    enrolled = kept_by(system, drone)
    own = system.call("GET", path_of(drone), key=enrolled["key"])
    foreign = system.call("GET", "/v1/deliveries", key=enrolled["key"])
    used = system.call(
        "POST", "/v1/enrolments", key="none", body={"enrolment_token": drone["enrolment_token"]}
    )
    first.send_signal(signal.SIGTERM)
    first.wait(timeout=30)
    until(system, drone, "OFFLINE")

    second = run(system, "--rotate")
    until(system, drone, "AVAILABLE")
    rotated = kept_by(system, drone)
    old = system.call("GET", path_of(drone), key=enrolled["key"])
    cut_off_s = cut_off(system, drone)
    gone_s = until(system, drone, "OFFLINE")
    limit_s = a_second(system, drone)
    revoked = system.call("GET", path_of(drone), key=rotated["key"])
    made = system.operate("POST", f"{path_of(drone)}/enrolment-tokens")
    second.send_signal(signal.SIGTERM)
    second.wait(timeout=30)
    run(system, token=made["enrolment_token"])
    until(system, drone, "AVAILABLE")

    assert (own.status_code, foreign.status_code) == (200, 403)
    assert (used.status_code, used.json()["code"]) == (409, "TOKEN_USED")
    assert (old.status_code, revoked.status_code) == (401, 401)
    assert cut_off_s < limit_s
    assert gone_s < limit_s
    again = kept_by(system, drone)
    keys = {one["key"] for one in (enrolled, rotated, again)}
    passwords = {one["mqtt"]["password"] for one in (enrolled, rotated, again, drone)}
    assert (len(keys), len(passwords)) == (3, 4)
    secrets = keys | passwords | {drone["enrolment_token"], made["enrolment_token"]}
    folder = system.folder.path
    told = [path for pattern in ("logs/*", "*.db*", "*.log") for path in folder.glob(pattern)]
    assert [p.name for p in told for one in secrets if one.encode() in p.read_bytes()] == []
