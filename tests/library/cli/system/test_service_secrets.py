"""`skyway secrets --service-secrets`: each service gets its own secrets, and hashes of others'."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from skyway.broker_setup.passwords import matches
from skyway.cli.data_folder import CLOUD_SERVICES, DataFolder
from skyway.cli.main import make_app
from skyway.cli.system.service_secrets import OWN, PEERS
from skyway.runtime.peer_secrets import secret_hash

#: Public, or for all services on purpose.
_SHARED = {"metrics_key", "cloud_keys"}


@pytest.fixture
def made(tmp_path: Path) -> tuple[DataFolder, Path]:
    folder, target = DataFolder(tmp_path / "data"), tmp_path / "services"
    options = ["secrets", "--data", str(folder.path), "--service-secrets", str(target)]
    options += ["--postgres-host=db", "--postgres-passwords", str(tmp_path / "postgres")]
    done = CliRunner().invoke(make_app(), options)
    assert done.exit_code == 0, done.output
    return folder, target


@pytest.mark.parametrize("service", CLOUD_SERVICES)
def test_no_service_reads_a_secret_of_another(made: tuple[DataFolder, Path], service: str) -> None:
    folder, target = made
    foreign = {
        path.read_text().strip()
        for path in folder.secrets.iterdir()
        if path.name not in {*OWN[service], *_SHARED, f"pgpass_{service}"}
    }
    assert len(foreign) >= 6

    read = [path.read_text() for path in (target / service).iterdir()]

    assert not [text for text in read for secret in foreign if secret in text]


@pytest.mark.parametrize("service", CLOUD_SERVICES)
def test_a_service_recognises_its_peers(made: tuple[DataFolder, Path], service: str) -> None:
    folder, target = made

    for peer in PEERS[service]:
        secret = (folder.secrets / f"service_{peer}").read_text().strip()
        assert (target / service / f"service_{peer}.sha256").read_text() == secret_hash(
            secret
        ) + "\n"
    assert (target / service / "pgpass").read_text().startswith("db:*:*:skyway_")


def test_the_registry_gets_hashes_of_the_brokers_passwords(made: tuple[DataFolder, Path]) -> None:
    folder, target = made

    for account in ("gateway", "composition", "operator"):
        password = (folder.secrets / f"mqtt_{account}").read_text().strip()
        hashed = (target / "registry" / f"mqtt_{account}.hash").read_text().strip()
        assert matches(password, hashed)


def test_only_this_user_reads_the_files(made: tuple[DataFolder, Path]) -> None:
    _, target = made

    assert {path.stat().st_mode & 0o077 for path in target.glob("*/*")} == {0}
    assert (target / "commands" / "keys.env").exists()
