"""Calls to the gateway, their problems in words, and the keys of the command line."""

from pathlib import Path
from typing import Any

import pytest
import typer

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import call_gateway, read_keys
from tests.library.cli.conftest import Gateway


@pytest.fixture(autouse=True)
def no_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("SKYWAY_GATEWAY_URL", "SKYWAY_OPERATOR_KEY"):
        monkeypatch.delenv(name, raising=False)


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
