"""Calls to the gateway, their problems in words, and the keys of the command line."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from skyway.cli.data_folder import DataFolder, held, is_starting, note_ready
from skyway.cli.gateway import call_gateway, gateway_and_key, needed_settings, read_keys
from skyway.errors import SkywayError
from tests.library.cli.conftest import Gateway


@pytest.fixture(autouse=True)
def no_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("GATEWAY_URL", "OPERATOR_KEY", "PROVIDER_KEY", "CUSTOMER_KEY"):
        monkeypatch.delenv(f"SKYWAY_{name}", raising=False)


def test_lines_are_read_as_a_shell_reads_them(tmp_path: Path) -> None:
    lines = [
        "# made by skyway up",
        "export SKYWAY_GATEWAY_URL=http://127.0.0.1:8000",
        "SKYWAY_OPERATOR_KEY='sk_a=b'",
        "",
        "echo hello",
    ]
    (tmp_path / "keys.env").write_text("\n".join(lines))

    keys = read_keys(DataFolder(tmp_path))

    assert keys["SKYWAY_GATEWAY_URL"] == "http://127.0.0.1:8000"
    assert keys["SKYWAY_OPERATOR_KEY"] == "sk_a=b"


def test_a_setting_of_the_environment_comes_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "keys.env").write_text("export SKYWAY_OPERATOR_KEY=old\n")
    monkeypatch.setenv("SKYWAY_OPERATOR_KEY", "new")

    assert read_keys(DataFolder(tmp_path))["SKYWAY_OPERATOR_KEY"] == "new"


def test_a_missing_file_holds_no_keys(tmp_path: Path) -> None:
    assert "SKYWAY_OPERATOR_KEY" not in read_keys(DataFolder(tmp_path))


@pytest.mark.parametrize(
    ("in_environment", "in_file", "chosen"),
    [
        ((), ("CUSTOMER", "PROVIDER", "OPERATOR"), "file OPERATOR"),
        ((), ("CUSTOMER", "PROVIDER"), "file PROVIDER"),
        ((), ("CUSTOMER",), "file CUSTOMER"),
        (("PROVIDER",), ("OPERATOR", "PROVIDER"), "environment PROVIDER"),
        (("OPERATOR", "PROVIDER"), (), "environment OPERATOR"),
    ],
)
def test_a_command_calls_with_the_first_key_of_the_environment_then_of_the_file(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    in_environment: tuple[str, ...],
    in_file: tuple[str, ...],
    chosen: str,
) -> None:
    for role in in_environment:
        monkeypatch.setenv(f"SKYWAY_{role}_KEY", f"environment {role}")
    monkeypatch.setenv("SKYWAY_GATEWAY_URL", "http://127.0.0.1:9")
    lines = [f"export SKYWAY_{role}_KEY='file {role}'\n" for role in in_file]
    (tmp_path / "keys.env").write_text("".join(lines))

    assert gateway_and_key(DataFolder(tmp_path)) == ("http://127.0.0.1:9", chosen)


@pytest.mark.parametrize(
    ("problem", "printed"),
    [
        ({"detail": "no delivery 'dlv_1'"}, "404: no delivery 'dlv_1'\n"),
        (
            {"detail": "mass: too heavy", "errors": [{"field": "mass", "detail": "too heavy"}]},
            "404: mass: too heavy\n",
        ),
        (
            {
                "detail": "0.a: no; 1.a: no",
                "errors": [{"field": "0.a", "detail": "no"}, {"field": "1.a", "detail": "no"}],
            },
            "404: \n  0.a: no\n  1.a: no\n",
        ),
        (
            {"detail": "two limits", "errors": [{"field": "a", "detail": "no"}]},
            "404: two limits\n  a: no\n",
        ),
    ],
)
def test_each_error_of_a_problem_is_printed_once(
    answering_gateway: Gateway,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    problem: dict[str, Any],
    printed: str,
) -> None:
    answering_gateway.answers["GET", "/v1/x"] = (404, problem)

    with pytest.raises(typer.Exit):
        call_gateway("GET", "/v1/x", key_name="SKYWAY_CUSTOMER_KEY", folder=DataFolder(tmp_path))

    assert capsys.readouterr().err == f"GET /v1/x was answered {printed}"


@pytest.fixture
def starting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[[Callable[[], object]], None]]:
    """A system that starts on the folder, and is ready after a command has waited once."""
    folder = DataFolder(tmp_path)

    def ready_after(change: Callable[[], object]) -> None:
        def end_of_start(_: float) -> None:
            change()
            note_ready(folder)

        monkeypatch.setattr(time, "sleep", end_of_start)

    with held(folder):
        yield ready_after


Starting = Callable[[Callable[[], object]], None]
WAITING = "Skyway is starting; this command goes on when it is ready.\n"


def test_a_command_waits_for_a_system_that_starts(
    answering_gateway: Gateway,
    starting: Starting,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    answers = answering_gateway.answers
    answers["GET", "/v1/x"] = (503, {"detail": "service is unavailable: it is starting"})
    starting(lambda: answers.update({("GET", "/v1/x"): (200, {"a": 1})}))

    found = call_gateway(
        "GET", "/v1/x", key_name="SKYWAY_CUSTOMER_KEY", folder=DataFolder(tmp_path)
    )

    assert found == {"a": 1}
    assert capsys.readouterr().err == WAITING


def test_a_command_waits_for_the_keys_of_a_system_that_starts(
    starting: Starting, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keys = tmp_path / "keys.env"
    starting(lambda: keys.write_text("export SKYWAY_GATEWAY_URL=http://gateway:1\n"))

    found = needed_settings(DataFolder(tmp_path), "SKYWAY_GATEWAY_URL")

    assert found["SKYWAY_GATEWAY_URL"] == "http://gateway:1"
    assert capsys.readouterr().err == WAITING


def test_a_command_does_not_wait_for_a_part_that_a_ready_system_lacks(
    answering_gateway: Gateway, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = DataFolder(tmp_path)
    answering_gateway.answers["GET", "/v1/x"] = (503, {"detail": "composition is unavailable"})

    with held(folder):
        note_ready(folder)
        with pytest.raises(typer.Exit):
            call_gateway("GET", "/v1/x", key_name="SKYWAY_CUSTOMER_KEY", folder=folder)

    assert "503: composition is unavailable" in capsys.readouterr().err


def test_a_system_that_was_ready_before_it_was_killed_is_not_starting(tmp_path: Path) -> None:
    folder = DataFolder(tmp_path)
    with held(folder):
        assert is_starting(folder)
        note_ready(folder)
        assert not is_starting(folder)
        with pytest.raises(SkywayError), held(folder):
            pass
        assert not is_starting(folder)

    assert not is_starting(folder)
    with held(folder):
        assert is_starting(folder)


def test_a_key_with_other_characters_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SKYWAY_GATEWAY_URL", "http://127.0.0.1:9")
    monkeypatch.setenv("SKYWAY_CUSTOMER_KEY", "clé")

    with pytest.raises(typer.Exit):
        call_gateway("GET", "/v1/clock", folder=DataFolder(tmp_path))

    assert "SKYWAY_CUSTOMER_KEY holds characters that no key has" in capsys.readouterr().err
