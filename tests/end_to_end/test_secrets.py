"""Nobody but its user can read the files of a system, and no log holds a secret."""

import contextlib
from pathlib import Path
from typing import Any

import pytest

pytestmark = [pytest.mark.end_to_end, pytest.mark.storage_pair("embedded")]


def test_no_other_user_can_read_the_files_of_a_system(system: Any) -> None:
    system.folder.path.chmod(0o755)
    system.publish_corridor("modes")
    system.start_fleet(["modes-s1"])

    written_by_the_test = ("up.log", "fleet.log", "drone.log", "prv_")
    modes = {
        name: mode
        for name, mode in modes_in(system.folder.path).items()
        if not name.startswith(written_by_the_test)
    }
    assert modes.keys() >= {"keys.env", "logs", "secrets"}
    assert [name for name, mode in modes.items() if mode & 0o077] == []


def test_no_secret_is_in_a_log_or_in_a_database(system: Any) -> None:
    system.publish_corridor("secrets")
    key = {"role": "customer", "subject_id": "alice"}
    issued = system.operate("POST", "/v1/keys", key)
    registered = system.start_fleet(["secrets-s1"])
    folder = system.folder.path
    secrets = {path.read_text().strip() for path in (folder / "secrets").iterdir()}
    secrets |= {issued["key"], issued["mqtt"]["password"], registered["key"]}
    secrets |= {drone["mqtt"]["password"] for drone in registered["drones"]}

    files = [path for pattern in ("logs/*", "*.db*", "*.log") for path in folder.glob(pattern)]
    found = [path.name for path in files for one in secrets if one.encode() in path.read_bytes()]

    assert files
    assert found == []


def modes_in(folder: Path) -> dict[str, int]:
    """The modes of the files in a folder. Temporary files can vanish meanwhile."""
    modes = {}
    for path in folder.iterdir():
        with contextlib.suppress(FileNotFoundError):
            modes[path.name] = path.stat().st_mode
    return modes
