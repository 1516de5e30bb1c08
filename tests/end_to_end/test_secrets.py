"""What a system keeps is its user's alone."""

from typing import Any

import pytest

pytestmark = pytest.mark.end_to_end


def test_nobody_else_can_read_what_a_system_keeps(system: Any) -> None:
    system.folder.path.chmod(0o755)
    system.publish_corridor("modes")
    system.start_fleet(["modes-s1"])

    by_the_test_itself = ("up.log", "fleet.log", "drone.log", "prv_")
    kept = [
        path
        for path in system.folder.path.iterdir()
        if not path.name.startswith(by_the_test_itself)
    ]
    assert {"gateway.db", "keys.env", "logs"} & {path.name for path in kept}
    assert [path.name for path in kept if path.stat().st_mode & 0o077] == []


def test_no_secret_is_told_in_a_log_or_kept_in_a_database(system: Any) -> None:
    system.publish_corridor("secrets")
    key = {"role": "customer", "subject_id": "alice"}
    issued = system.operate("POST", "/v1/keys", key)
    registered = system.start_fleet(["secrets-s1"])
    folder = system.folder.path
    secrets = {path.read_text().strip() for path in (folder / "secrets").iterdir()}
    secrets |= {issued["key"], issued["mqtt"]["password"], registered["key"]}
    secrets |= {drone["mqtt"]["password"] for drone in registered["drones"]}

    told = [path for pattern in ("logs/*", "*.db*", "*.log") for path in folder.glob(pattern)]
    found = [path.name for path in told for one in secrets if one.encode() in path.read_bytes()]

    assert told
    assert found == []
