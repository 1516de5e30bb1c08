"""The registry's settings."""

from pathlib import Path

import pytest
from skyway_provider_registry.settings import RegistrySettings

from skyway.runtime.errors import InvalidSettings


@pytest.fixture(autouse=True)
def needed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("SKYWAY_DATABASE_URL", "sqlite:///registry.db")
    monkeypatch.setenv("SKYWAY_MQTT_URL", "mqtt://127.0.0.1:1")
    monkeypatch.setenv("SKYWAY_SECRETS_DIR", str(tmp_path))
    monkeypatch.setenv("SKYWAY_COMPOSITION_URL", "http://127.0.0.1:2")
    monkeypatch.setenv("SKYWAY_BROKER_PASSWORD_FILE", str(tmp_path / "passwords"))
    monkeypatch.delenv("SKYWAY_MQTT_DRONE_URL", raising=False)


def test_drones_get_every_address_of_a_cluster(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SKYWAY_MQTT_DRONE_URL", "mqtts+nats://one:8883, mqtts+nats://two:8883")

    assert RegistrySettings.load().mqtt_drone_url == (
        "mqtts+nats://one:8883",
        "mqtts+nats://two:8883",
    )


def test_without_the_setting_an_enrolment_names_no_broker() -> None:
    assert RegistrySettings.load().mqtt_drone_url == ()


def test_a_wrong_broker_address_is_refused_with_the_name_of_its_setting(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("SKYWAY_MQTT_DRONE_URL", "mqtt://one:1883,two:1883")

    with pytest.raises(InvalidSettings, match=r"SKYWAY_MQTT_DRONE_URL: .*mqtts://host:port"):
        RegistrySettings.load()
