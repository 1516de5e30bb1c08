from pathlib import Path

import pytest

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import read_keys


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


def test_the_environment_wins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "keys.env").write_text("export SKYWAY_OPERATOR_KEY=old\n")
    monkeypatch.setenv("SKYWAY_OPERATOR_KEY", "new")

    assert read_keys(DataFolder(tmp_path))["SKYWAY_OPERATOR_KEY"] == "new"


def test_a_missing_file_holds_no_keys(tmp_path: Path) -> None:
    assert "SKYWAY_OPERATOR_KEY" not in read_keys(DataFolder(tmp_path))
