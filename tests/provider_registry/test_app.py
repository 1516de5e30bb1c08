"""The registry as a process, and the document of its routes."""

import asyncio
import json
import sqlite3
import subprocess
import sys
from pathlib import Path

from skyway_provider_registry.app import PACKAGE, openapi_app

from skyway.runtime.sql.migrations import migrate


def test_the_openapi_document_opens_nothing() -> None:
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


def test_verify_prints_each_violation_as_a_line(tmp_path: Path) -> None:
    path = tmp_path / "registry.db"
    asyncio.run(migrate(f"sqlite:///{path}", PACKAGE))
    with sqlite3.connect(path) as connection:
        connection.execute("INSERT INTO broker_accounts VALUES ('drn_9', 'DRONE', '', NULL)")
    connection.close()

    verified = run("verify", SKYWAY_DATABASE_URL=f"sqlite:///{path}")

    assert verified.returncode == 1
    subjects = [json.loads(line)["subject"] for line in verified.stdout.splitlines()]
    assert subjects == ["broker_accounts.password_hash of broker_accounts drn_9", "drn_9"]
