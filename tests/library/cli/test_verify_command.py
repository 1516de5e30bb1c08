"""`skyway verify` prints what is broken; `--repair` adds what a person can do about it."""

import asyncio
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from skyway.cli.data_folder import CLOUD_SERVICES
from skyway.cli.main import make_app
from skyway.cli.system.children import PACKAGES
from skyway.runtime.sql.migrations import migrate

Verify = Callable[..., Result]

#: A broker account without a drone, and with a password hash that is none.
BREAK = "INSERT INTO broker_accounts VALUES ('drn_9', 'DRONE', '', NULL)"
BROKEN_RULE = 'registry: {"rule": "every drone\'s broker account has a drone", "subject": "drn_9"}'


@pytest.fixture(scope="module")
def empty_databases(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data folder whose databases have tables without rows."""
    folder = tmp_path_factory.mktemp("empty")
    for service in CLOUD_SERVICES:
        asyncio.run(migrate(f"sqlite:///{folder}/{service}.db", PACKAGES[service]))
    return folder


@pytest.fixture
def folder(empty_databases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A data folder whose registry breaks two rules."""
    for name in ("SKYWAY_DATABASE_URL", "SKYWAY_CLOCK_FILE"):
        monkeypatch.delenv(name, raising=False)
    shutil.copytree(empty_databases, tmp_path, dirs_exist_ok=True)
    with closing(sqlite3.connect(tmp_path / "registry.db")) as registry:
        registry.execute(BREAK)
        registry.commit()
    return tmp_path


@pytest.fixture
def verify(folder: Path) -> Verify:
    """Run the command with these options."""
    return lambda *options: CliRunner().invoke(
        make_app(), ["verify", "--data", str(folder), *options]
    )


@pytest.mark.parametrize("options", [[], ["--repair"]])
def test_repair_says_what_a_person_can_do_about_each_violation(
    verify: Verify, options: list[str]
) -> None:
    result = verify(*options)

    lines = result.output.splitlines()
    advice = [line for line in lines if line.startswith("    If the drone was removed, delete ")]
    assert BROKEN_RULE in lines
    assert len(advice) == len(options)
    assert lines[-1] == "2 violations in 3 databases"
    assert result.exit_code == 1


def test_no_database_is_changed(verify: Verify, folder: Path) -> None:
    before = {each: (folder / f"{each}.db").read_bytes() for each in CLOUD_SERVICES}
    for service in CLOUD_SERVICES:
        (folder / f"{service}.db").chmod(0o444)

    assert verify().exit_code == 1
    assert {each: (folder / f"{each}.db").read_bytes() for each in CLOUD_SERVICES} == before


@pytest.mark.parametrize("is_in_environment", [False, True])
def test_one_database_is_checked_alone(
    verify: Verify, folder: Path, is_in_environment: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = f"sqlite:///{folder}/registry.db"
    for service in ("gateway", "composition"):
        (folder / f"{service}.db").unlink()
    if is_in_environment:
        monkeypatch.setenv("SKYWAY_DATABASE_URL", url)

    result = verify("--database", "registry" if is_in_environment else f"registry={url}")

    assert BROKEN_RULE in result.output
    assert "2 violations in 1 databases" in result.output
    assert result.exit_code == 1


@pytest.mark.parametrize(
    ("option", "error"),
    [
        ("pigeons=sqlite:///pigeons.db", "'pigeons' is not one of registry, composition, gateway"),
        ("registry", "registry: neither =URL nor SKYWAY_DATABASE_URL is set"),
        ("registry=mysql://localhost/x", "mysql: only sqlite:///path and postgresql://..."),
    ],
)
def test_a_wrong_database_is_named(verify: Verify, option: str, error: str) -> None:
    result = verify("--database", option)

    assert error in result.output
    assert result.exit_code == 2


def test_a_database_that_does_not_answer_is_named_and_the_others_are_checked(
    verify: Verify, folder: Path
) -> None:
    named = [f"{each}=sqlite:///{folder}/{each}.db" for each in ("registry", "gateway")]
    named.append("composition=postgresql://skyway@127.0.0.1:1/skyway_composition")

    result = verify(*(part for each in named for part in ("--database", each)))

    assert BROKEN_RULE in result.output
    assert "2 violations in 2 databases" in result.output
    assert "composition could not be checked: database is unavailable" in result.output
    assert result.exit_code == 2


def test_a_damaged_database_breaks_a_rule_and_the_others_are_checked(
    verify: Verify, folder: Path
) -> None:
    for file in folder.glob("gateway.db*"):
        file.write_text("this was a database once, and is none any more" * 100)

    result = verify()

    assert BROKEN_RULE in result.output
    assert 'gateway: {"rule": "the database can be opened"' in result.output
    assert result.exit_code == 1
