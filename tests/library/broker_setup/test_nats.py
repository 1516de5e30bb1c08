"""The configuration of NATS is what its own program takes."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from skyway.broker_setup.certificates import CertificateAuthority
from skyway.broker_setup.nats import NatsNode, NatsTls, nats_conf
from skyway.broker_setup.nats_accounts import hash_for_nats, nats_accounts
from skyway.contracts.broker_rules import BrokerRules
from skyway.runtime.errors import InvalidSettings

NODES = ("node-a:6222", "node-b:6222", "node-c:6222")


@pytest.fixture
def tls(tmp_path: Path) -> NatsTls:
    signed = CertificateAuthority.make(tmp_path / "ca").sign_node(("localhost", "127.0.0.1"))
    files = NatsTls(tmp_path / "ca" / "ca.pem", tmp_path / "node.pem", tmp_path / "key.pem")
    files.certificate_file.write_text(signed.certificate_pem)
    files.key_file.write_text(signed.private_key_pem)
    return files


@pytest.mark.parametrize("nodes", [(), NODES])
@pytest.mark.parametrize("is_encrypted", [False, True])
def test_nats_finds_no_fault_in_the_configuration(
    tmp_path: Path, tls: NatsTls, nodes: tuple[str, ...], is_encrypted: bool
) -> None:
    node = NatsNode("a", "127.0.0.1", 1883, 6222, tmp_path / "js", cluster_password="p")
    if is_encrypted:
        node = replace(node, tls=tls, cluster_tls=tls)
    hashes = {name: hash_for_nats(name) for name in ("gateway", "p/d", "customer", "operator/o")}
    (tmp_path / "accounts.conf").write_text(nats_accounts(hashes, BrokerRules()))
    configuration = tmp_path / "nats.conf"
    configuration.write_text(nats_conf(node, nodes=nodes, accounts_file="accounts.conf"))

    program = Path(sys.executable).with_name("nats-server")
    checked = subprocess.run(
        [program, "-t", "-c", configuration], capture_output=True, text=True, check=False
    )

    assert checked.returncode == 0, checked.stderr
    assert "WRN" not in checked.stderr
    assert "invalid" not in checked.stderr


def test_nodes_of_a_cluster_check_each_others_certificates(tmp_path: Path, tls: NatsTls) -> None:
    node = NatsNode("a", "127.0.0.1", 1883, 6222, tmp_path, tls, tls, cluster_password="p")

    text = nats_conf(node, nodes=NODES, accounts_file="accounts.conf")

    clients, cluster = text.split("cluster {")
    assert "verify: false" in clients
    assert "verify: true" in cluster


def test_a_cluster_without_a_password_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidSettings, match="password"):
        nats_conf(
            NatsNode("a", "127.0.0.1", 1883, 6222, tmp_path), nodes=NODES, accounts_file="a.conf"
        )
