"""The registry as a process, and the document of its routes."""

import subprocess
import sys
from pathlib import Path

from skyway_provider_registry.app import openapi_app


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


def test_migrate_needs_only_a_database(tmp_path: Path) -> None:
    migrated = run("migrate", SKYWAY_DATABASE_URL=f"sqlite:///{tmp_path}/registry.db")

    assert (migrated.returncode, migrated.stderr) == (0, "")
