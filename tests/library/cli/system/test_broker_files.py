"""`skyway secrets --tls-name`: an authority, and the files of Mosquitto's TLS listener."""

import ssl
from pathlib import Path

from typer.testing import CliRunner

from skyway.broker_setup.certificates import CertificateAuthority
from skyway.cli.data_folder import DataFolder
from skyway.cli.main import make_app


def make_secrets(folder: DataFolder, *options: str) -> str:
    done = CliRunner().invoke(make_app(), ["secrets", "--data", str(folder.path), *options])
    assert done.exit_code == 0, done.output
    return (folder.broker / "mosquitto.conf").read_text()


def test_a_deployment_with_an_authority_asks_drones_for_certificates(tmp_path: Path) -> None:
    folder = DataFolder(tmp_path / "data")

    configuration = make_secrets(folder, "--tls-name", "broker.example", "--tls-name", "127.0.0.1")

    assert "listener 8883 127.0.0.1" in configuration
    assert "require_certificate true" in configuration
    context = ssl.create_default_context(cafile=str(folder.broker / "ca.pem"))
    context.load_cert_chain(folder.broker / "server.pem", folder.broker / "server-key.pem")
    modes = {path.name: path.stat().st_mode & 0o077 for path in folder.broker.glob("*.pem")}
    assert modes == dict.fromkeys(("ca.pem", "server.pem", "server-key.pem", "revoked.pem"), 0)


def test_the_authority_stays_when_secrets_are_made_again(tmp_path: Path) -> None:
    folder = DataFolder(tmp_path / "data")
    make_secrets(folder, "--tls-name", "localhost")
    before = CertificateAuthority.load(folder.drone_ca).certificate_pem

    make_secrets(folder, "--tls-name", "localhost")

    assert CertificateAuthority.load(folder.drone_ca).certificate_pem == before


def test_without_a_name_there_is_no_authority(tmp_path: Path) -> None:
    folder = DataFolder(tmp_path / "data")

    configuration = make_secrets(folder)

    assert "8883" not in configuration
    assert not folder.drone_ca.exists()
