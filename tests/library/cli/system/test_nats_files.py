"""`skyway nats`: a folder for each node, with which its program runs."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.x509.oid import ExtendedKeyUsageOID
from typer.testing import CliRunner

from skyway.broker_setup.certificates import CertificateAuthority
from skyway.cli.data_folder import DataFolder
from skyway.cli.main import make_app


def test_each_node_gets_a_configuration_that_nats_takes(tmp_path: Path) -> None:
    folder = DataFolder(tmp_path / "data")
    hosts = ["a.example", "b.example", "127.0.0.1"]

    done = CliRunner().invoke(make_app(), ["nats", *hosts, "--data", str(folder.path)])

    assert done.exit_code == 0, done.output
    urls = "mqtts+nats://a.example:8883,mqtts+nats://b.example:8883,mqtts+nats://127.0.0.1:8883"
    assert f"SKYWAY_MQTT_URL={urls}" in done.output
    places = sorted((folder.broker / "nats").iterdir())
    assert [place.name for place in places] == ["node-0", "node-1", "node-2"]
    for place in places:
        assert {path.stat().st_mode & 0o077 for path in place.iterdir()} == {0}
        program = Path(sys.executable).with_name("nats-server")
        checked = subprocess.run(
            [program, "-t", "-c", "nats.conf"],
            cwd=place,
            env=os.environ,
            capture_output=True,
            text=True,
            check=False,
        )
        assert checked.returncode == 0, checked.stderr


def test_drones_and_nodes_are_signed_by_different_authorities(tmp_path: Path) -> None:
    folder = DataFolder(tmp_path / "data")
    hosts = ["a.example", "b.example", "c.example"]
    CliRunner().invoke(make_app(), ["nats", *hosts, "--data", str(folder.path)])
    place = folder.broker / "nats" / "node-0"
    authority, node, clients = (
        x509.load_pem_x509_certificate((place / name).read_bytes())
        for name in ("cluster-ca.pem", "cluster.pem", "node.pem")
    )
    drone = CertificateAuthority.load(folder.drone_ca).sign_drone("drn_1")
    usage = clients.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value

    node.verify_directly_issued_by(authority)
    with pytest.raises((ValueError, InvalidSignature)):
        x509.load_pem_x509_certificate(drone.certificate_pem.encode()).verify_directly_issued_by(
            authority
        )
    assert list(usage) == [ExtendedKeyUsageOID.SERVER_AUTH]


def test_all_nodes_have_one_password_that_stays(tmp_path: Path) -> None:
    folder = DataFolder(tmp_path / "data")
    hosts = ["a.example", "b.example", "c.example"]
    for _ in range(2):
        CliRunner().invoke(make_app(), ["nats", *hosts, "--data", str(folder.path)])

    password = (folder.secrets / "nats_cluster").read_text().strip()
    for place in (folder.broker / "nats").iterdir():
        assert f"nats://node:{password}@b.example:6222" in (place / "nats.conf").read_text()


@pytest.mark.parametrize("hosts", [["a", "b"], ["a", "a", "b"], ["a", "b", "c", "d"]])
def test_a_number_of_nodes_without_a_majority_is_refused(tmp_path: Path, hosts: list[str]) -> None:
    done = CliRunner().invoke(make_app(), ["nats", *hosts, "--data", str(tmp_path)])

    assert done.exit_code != 0
    assert "majority" in done.output
