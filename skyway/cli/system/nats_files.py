"""`skyway nats`: the files with which each node of a cluster of NATS runs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from skyway.broker_setup.private_file import write_private
from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.gateway import fail

if TYPE_CHECKING:
    from skyway.broker_setup.nats import NatsTls

#: The ports of nodes that name none: for MQTT over TLS, and between nodes.
_MQTT_PORT: Final = 8883
_CLUSTER_PORT: Final = 6222

#: The secret that nodes show each other.
_CLUSTER_PASSWORD: Final = "nats_cluster"  # noqa: S105 - the name of a file

#: Where the registry's accounts lie, as seen from a node's folder.
_ACCOUNTS: Final = "../../passwords"


def nats_command(
    hosts: Annotated[
        list[str],
        typer.Argument(
            metavar="HOST...", help="The name or address of each node: one, three or five."
        ),
    ],
    listen: Annotated[str, typer.Option(help="The address on which nodes listen.")] = "0.0.0.0",  # noqa: S104 - a broker is for others
    mqtt_port: Annotated[int, typer.Option(help="The port for MQTT over TLS.")] = _MQTT_PORT,
    cluster_port: Annotated[int, typer.Option(help="The port between nodes.")] = _CLUSTER_PORT,
    data: DataOption = None,
) -> None:
    """Write a folder for each node of NATS, with its configuration and its certificates."""
    if len(hosts) not in (1, 3, 5) or len(set(hosts)) < len(hosts):
        fail("name one, three or five different nodes: JetStream decides by a majority")
    from skyway.broker_setup.nats import NatsNode, nats_conf
    from skyway.broker_setup.nats_accounts import NatsAccounts
    from skyway.cli.system.secrets import make_secret, make_secrets, read_secret

    folder = data_folder(data)
    make_secrets(folder)
    if not folder.broker_passwords.exists():
        NatsAccounts(folder.broker_passwords).write({}, {})
    make_secret(folder, _CLUSTER_PASSWORD)
    password = read_secret(folder, _CLUSTER_PASSWORD)
    routes = [f"{host}:{cluster_port}" for host in hosts]
    for number, host in enumerate(hosts):
        place = folder.broker / "nats" / f"node-{number}"
        tls, cluster_tls = _certificates(folder, place, host)
        node = NatsNode(
            *(f"node-{number}", listen, mqtt_port, cluster_port, Path("jetstream")),
            tls=tls,
            cluster_tls=cluster_tls,
            cluster_password=password,
        )
        text = nats_conf(node, nodes=routes, accounts_file=_ACCOUNTS)
        write_private(place / "nats.conf", text)
    urls = ",".join(f"mqtts+nats://{host}:{mqtt_port}" for host in hosts)
    typer.echo(
        f"{len(hosts)} folders are in {folder.broker / 'nats'}\n"
        f"SKYWAY_BROKER_KIND=nats\nSKYWAY_MQTT_URL={urls}\n"
        f"SKYWAY_MQTT_CA_FILE={folder.broker / 'nats' / 'node-0' / 'ca.pem'}"
    )


def _certificates(folder: DataFolder, place: Path, host: str) -> "tuple[NatsTls, NatsTls]":
    """A node's certificates, for its clients and for the other nodes.

    They come from two authorities. The first one also signs drones, and a drone must not join the
    cluster as a node.
    """
    from skyway.broker_setup.certificates import CertificateAuthority
    from skyway.broker_setup.nats import NatsTls

    place.mkdir(parents=True, exist_ok=True, mode=0o700)
    clients = CertificateAuthority.make(folder.drone_ca)
    nodes = CertificateAuthority.make(folder.node_ca, "Skyway nodes")
    files = (
        NatsTls(Path("ca.pem"), Path("node.pem"), Path("node-key.pem")),
        NatsTls(Path("cluster-ca.pem"), Path("cluster.pem"), Path("cluster-key.pem")),
    )
    signed = (clients, clients.sign_broker((host,))), (nodes, nodes.sign_node((host,)))
    for each, (authority, key) in zip(files, signed, strict=True):
        write_private(place / each.ca_file, authority.certificate_pem)
        write_private(place / each.key_file, key.private_key_pem)
        write_private(place / each.certificate_file, key.certificate_pem)
    return files
