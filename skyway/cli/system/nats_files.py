"""`skyway nats`: the files with which each node of a cluster of NATS runs."""

from pathlib import Path
from typing import Annotated, Final

import typer

from skyway.broker_setup.nats import NatsNode, NatsTls, nats_conf
from skyway.broker_setup.nats_accounts import NatsAccounts
from skyway.broker_setup.private_file import write_private
from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.gateway import fail
from skyway.cli.system.secrets import make_secrets

#: The ports of nodes that name none: for MQTT over TLS, and between nodes.
_MQTT_PORT: Final = 8883
_CLUSTER_PORT: Final = 6222

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
    """Write a folder for each node of NATS, with its configuration and its certificate."""
    if len(hosts) not in (1, 3, 5) or len(set(hosts)) < len(hosts):
        fail("name one, three or five different nodes: JetStream decides by a majority")
    folder = data_folder(data)
    make_secrets(folder)
    if not folder.broker_passwords.exists():
        NatsAccounts(folder.broker_passwords).write({}, {})
    routes = [f"{host}:{cluster_port}" for host in hosts]
    for number, host in enumerate(hosts):
        place = folder.broker / "nats" / f"node-{number}"
        tls = _certificate(folder, place, host)
        node = NatsNode(
            f"node-{number}", listen, mqtt_port, cluster_port, Path("jetstream"), tls, tls
        )
        text = nats_conf(node, nodes=routes, accounts_file=_ACCOUNTS)
        write_private(place / "nats.conf", text)
    urls = ",".join(f"mqtts+nats://{host}:{mqtt_port}" for host in hosts)
    typer.echo(
        f"{len(hosts)} folders are in {folder.broker / 'nats'}\n"
        f"SKYWAY_BROKER_KIND=nats\nSKYWAY_MQTT_URL={urls}\n"
        f"SKYWAY_MQTT_CA_FILE={folder.broker / 'nats' / 'node-0' / 'ca.pem'}"
    )


def _certificate(folder: DataFolder, place: Path, host: str) -> NatsTls:
    # Imported here: X.509 takes a tenth of a second, and no other command needs it.
    from skyway.broker_setup.certificates import CertificateAuthority

    place.mkdir(parents=True, exist_ok=True, mode=0o700)
    authority = CertificateAuthority.make(folder.drone_ca)
    signed = authority.sign_node((host,))
    write_private(place / "ca.pem", authority.certificate_pem)
    write_private(place / "node-key.pem", signed.private_key_pem)
    write_private(place / "node.pem", signed.certificate_pem)
    return NatsTls(Path("ca.pem"), Path("node.pem"), Path("node-key.pem"))
