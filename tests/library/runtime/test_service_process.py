import json
import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import BigInteger, Column, MetaData, Table, true

from skyway.runtime.archive import ArchivedTable
from skyway.runtime.errors import ExitCode
from skyway.runtime.service_process import ServiceProcess
from skyway.runtime.settings import ServiceSettings


def make_process() -> ServiceProcess[ServiceSettings]:
    return ServiceProcess("tower", "skyway_tower", ServiceSettings, lambda _settings: 0, tuple)


@pytest.fixture
def a_database(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SKYWAY_DATABASE_URL", f"sqlite:///{tmp_path}/tower.db")


@pytest.mark.parametrize("command", ["serve", "migrate", "archive"])
def test_a_missing_setting_is_named(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("SKYWAY_DATABASE_URL", raising=False)

    code = make_process().run([command])

    assert code == 2
    assert "SKYWAY_DATABASE_URL" in capsys.readouterr().err


def test_a_damaged_database_and_one_that_is_away_have_codes_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "damaged.db").write_text("this was a database once, and is none any more" * 100)
    codes = {}

    for url in (f"sqlite:///{tmp_path}/damaged.db", f"sqlite:///{tmp_path}/nowhere/tower.db"):
        monkeypatch.setenv("SKYWAY_DATABASE_URL", url)
        codes[Path(url).stem] = make_process().run(["migrate"])

    assert codes == {"damaged": ExitCode.BAD_DATABASE, "tower": ExitCode.NOT_NOW}
    assert "it is damaged: file is not a database" in capsys.readouterr().err


@pytest.mark.usefixtures("a_database")
def test_archive_prints_a_line_for_each_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flights = Table("flights", MetaData(), Column("at_ms", BigInteger, primary_key=True))
    with sqlite3.connect(tmp_path / "tower.db") as database:
        database.execute("CREATE TABLE flights (at_ms INTEGER)")
        database.executemany("INSERT INTO flights VALUES (?)", [(1,), (2,), (86_400_000,)])
    database.close()
    archived = ArchivedTable(flights, flights.c.at_ms, flights, true())
    process = replace(make_process(), archived=lambda: [archived])

    code = process.run(["archive", "--folder", str(tmp_path / "archive")])

    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert (code, lines) == (
        0,
        [
            {"table": "flights", "day": "1970-01-01", "rows": 2},
            {"table": "flights", "day": "1970-01-02", "rows": 1},
        ],
    )
    assert (tmp_path / "archive" / "flights" / "1970-01-02.parquet").exists()
