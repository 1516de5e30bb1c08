"""A package with one migration."""

from pathlib import Path

import pytest

from tests.library.runtime.sql.migration_package import Package


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Package:
    # A name of its own: a package once imported is not looked for in another folder.
    made = Package(tmp_path, f"service_{tmp_path.name}")
    made.revise("0001", "CREATE TABLE stations (name TEXT)")
    monkeypatch.syspath_prepend(tmp_path)
    return made
