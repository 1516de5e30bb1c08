"""The registry as a process, and the document of its routes."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from skyway_provider_registry.app import openapi_app


def test_the_document_of_the_routes_needs_nothing_opened() -> None:
    document = openapi_app().openapi()

    assert document["openapi"].startswith("3.1")
    assert "/v1/providers/{provider_id}/drones" in document["paths"]
    assert "/internal/candidates" in document["paths"]


def run(command: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", "skyway_provider_registry", command],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def test_migrate_and_verify_need_only_a_database(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path}/registry.db"

    migrated = run("migrate", SKYWAY_DATABASE_URL=url)
    verified = run("verify", SKYWAY_DATABASE_URL=url)

    assert (migrated.returncode, migrated.stderr) == (0, "")
    assert (verified.returncode, verified.stdout) == (0, "")


def test_verify_tells_each_violation_as_a_line(tmp_path: Path, migrated_file: Path) -> None:
    import sqlite3

    path = tmp_path / "registry.db"
    path.write_bytes(migrated_file.read_bytes())
    with sqlite3.connect(path) as connection:
        connection.execute("INSERT INTO broker_accounts VALUES ('drn_9', 'DRONE', '')")
    connection.close()

    verified = run("verify", SKYWAY_DATABASE_URL=f"sqlite:///{path}")

    assert verified.returncode == 1
    assert [json.loads(line)["subject"] for line in verified.stdout.splitlines()] == ["drn_9"]


@pytest.mark.parametrize("command", ["serve", "migrate", "verify"])
def test_a_missing_setting_is_named(command: str) -> None:
    finished = run(command)

    assert finished.returncode == 2
    assert "SKYWAY_DATABASE_URL" in finished.stderr
