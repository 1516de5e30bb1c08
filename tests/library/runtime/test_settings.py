"""What a service reads from its environment."""

import ssl
from pathlib import Path

import pytest

from skyway.broker_setup.certificates import CertificateAuthority
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


def test_the_brokers_authority_is_trusted_instead_of_the_systems_roots(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert ServiceSettings.load().mqtt_tls is None
    authority = CertificateAuthority.make(tmp_path / "ca")
    monkeypatch.setenv("SKYWAY_MQTT_CA_FILE", str(tmp_path / "ca" / "ca.pem"))

    context = ServiceSettings.load().mqtt_tls

    assert context is not None
    [trusted] = context.get_ca_certs(binary_form=True)
    assert trusted == ssl.PEM_cert_to_DER_cert(authority.certificate_pem)


@pytest.mark.parametrize("content", [None, "", "no certificate"])
def test_a_file_without_a_certificate_is_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, content: str | None
) -> None:
    path = tmp_path / "ca.pem"
    if content is not None:
        path.write_text(content)
    monkeypatch.setenv("SKYWAY_MQTT_CA_FILE", str(path))

    with pytest.raises(InvalidSettings, match=r"SKYWAY_MQTT_CA_FILE: .*ca\.pem holds no"):
        _ = ServiceSettings.load().mqtt_tls
