"""What a service reads from its environment."""

from pathlib import Path

import pytest

from skyway.runtime.errors import InvalidSettings
from skyway.runtime.settings import ServiceSettings


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Only what a service cannot do without."""
    monkeypatch.setenv("SKYWAY_DATABASE_URL", "postgresql://skyway:hunter2@db/gateway")
    monkeypatch.setenv("SKYWAY_MQTT_URL", "mqtt://broker:1883")
    monkeypatch.setenv("SKYWAY_SECRETS_DIR", str(tmp_path))


def test_settings_come_from_variables(tmp_path: Path) -> None:
    settings = ServiceSettings.load()

    assert settings.mqtt_url == "mqtt://broker:1883"
    assert settings.secrets_dir == tmp_path
    assert (settings.host, settings.log_level, settings.clock_file) == ("127.0.0.1", "INFO", None)


def test_a_missing_variable_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SKYWAY_DATABASE_URL")
    monkeypatch.delenv("SKYWAY_SECRETS_DIR")

    with pytest.raises(InvalidSettings, match=r"SKYWAY_DATABASE_URL: .*; SKYWAY_SECRETS_DIR: "):
        ServiceSettings.load()


def test_a_wrong_variable_is_named_without_its_value(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SKYWAY_PORT", "a-secret-by-mistake")

    with pytest.raises(InvalidSettings, match="SKYWAY_PORT") as refused:
        ServiceSettings.load()

    assert "a-secret-by-mistake" not in str(refused.value)


def test_settings_do_not_show_passwords() -> None:
    assert "hunter2" not in repr(ServiceSettings.load())
