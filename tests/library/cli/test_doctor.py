"""`skyway doctor` asks database, broker and gateway, and repeats what they answer."""

import socket
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.cli.main import make_app
from tests.library.cli.conftest import Gateway

runner = CliRunner()


@pytest.fixture(autouse=True)
def _no_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DATABASE_URL", "MQTT_URL", "OWN_MQTT_URL", "GATEWAY_URL"):
        monkeypatch.delenv(f"SKYWAY_{name}", raising=False)


@pytest.fixture
def closed_port() -> Iterator[int]:
    """A port on which nobody listens."""
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        yield bound.getsockname()[1]


def test_an_empty_folder_is_no_trouble(tmp_path: Path) -> None:
    result = runner.invoke(make_app(), ["doctor", "--data", str(tmp_path)])

    assert result.exit_code == 0
    assert "SQLite; skyway up makes the files" in result.stdout
    assert "the embedded broker (a hardened amqtt): skyway up starts it" in result.stdout


def test_a_named_database_that_does_not_answer_is_trouble(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, closed_port: int
) -> None:
    monkeypatch.setenv("SKYWAY_DATABASE_URL", f"postgresql://127.0.0.1:{closed_port}/x")

    result = runner.invoke(make_app(), ["doctor", "--data", str(tmp_path)])

    assert result.exit_code == 1
    assert "PostgreSQL at 127.0.0.1 does not answer" in result.stdout


@pytest.mark.parametrize(
    "database_url", [pytest.param("postgresql", marks=pytest.mark.integration)], indirect=True
)
def test_a_named_database_that_answers_shows_its_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, database_url: str
) -> None:
    monkeypatch.setenv("SKYWAY_DATABASE_URL", database_url)

    result = runner.invoke(make_app(), ["doctor", "--data", str(tmp_path)])

    assert result.exit_code == 0, result.stdout
    assert "answers: version" in result.stdout


def test_a_named_broker_that_does_not_answer_is_trouble(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, closed_port: int
) -> None:
    monkeypatch.setenv("SKYWAY_MQTT_URL", f"mqtt://127.0.0.1:{closed_port}")

    result = runner.invoke(make_app(), ["doctor", "--data", str(tmp_path)])

    assert result.exit_code == 1
    assert f"the broker at mqtt://127.0.0.1:{closed_port} does not answer" in result.stdout


def test_a_sqlite_file_that_is_no_database_is_trouble(tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / "gateway.db") as connection:
        connection.execute("CREATE TABLE t (x)")
    (tmp_path / "registry.db").write_text("not a database, but long enough to be read as one" * 9)

    result = runner.invoke(make_app(), ["doctor", "--data", str(tmp_path)])

    assert result.exit_code == 1
    assert f"reads {tmp_path / 'gateway.db'} (1 tables)" in result.stdout
    assert f"SQLite cannot read {tmp_path / 'registry.db'}" in result.stdout


def test_a_gateway_that_is_not_ready_says_what_is_missing(
    answering_gateway: Gateway, tmp_path: Path
) -> None:
    answering_gateway.answers["GET", "/readyz"] = (503, {"detail": "missing: database"})

    result = runner.invoke(make_app(), ["doctor", "--data", str(tmp_path)])

    assert result.exit_code == 1
    assert "answers: missing: database" in result.stdout


def test_a_gateway_without_a_broker_is_trouble(answering_gateway: Gateway, tmp_path: Path) -> None:
    answering_gateway.answers["GET", "/readyz"] = (200, {"checks": {"mqtt": False}})

    result = runner.invoke(make_app(), ["doctor", "--data", str(tmp_path)])

    assert result.exit_code == 1
    assert "no connection to the broker" in result.stdout


def test_a_running_system_without_network_and_provider_says_how_to_get_them(
    answering_gateway: Gateway, tmp_path: Path
) -> None:
    empty: tuple[int, Any] = (200, {"items": []})
    answering_gateway.answers |= {
        ("GET", "/readyz"): (200, {}),
        ("GET", "/v1/networks"): empty,
        ("GET", "/v1/providers"): empty,
    }

    result = runner.invoke(make_app(), ["doctor", "--data", str(tmp_path)])

    assert "no network is published: skyway network import bundled" in result.stdout
    assert "no provider is registered: skyway fleet --drones 10" in result.stdout
