"""A node of NATS lets in other nodes of its deployment only: real nodes try it."""

import asyncio
import re
import socket
import ssl
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import pytest

from skyway.broker_setup.certificates import CertificateAuthority, SignedKey
from skyway.broker_setup.nats import NatsNode, NatsTls, nats_conf
from skyway.broker_setup.nats_accounts import nats_accounts
from skyway.contracts.broker_rules import BrokerRules

NATS_SERVER: Final = Path(sys.executable).with_name("nats-server")
HOST: Final = "127.0.0.1"
LET_IN: Final = "Route connection created"
HANDSHAKE_FAILED: Final = "TLS route handshake error"
WRONG_PASSWORD: Final = "authentication error"


@dataclass(frozen=True, slots=True)
class Node:
    """A node that runs."""

    process: asyncio.subprocess.Process

    async def line_with(self, *texts: str) -> str:
        """The next line of its log that has one of these texts."""
        assert self.process.stderr is not None
        async with asyncio.timeout(30):
            while line := (await self.process.stderr.readline()).decode():
                if any(text in line for text in texts):
                    return line
        raise AssertionError(f"the node has ended before it said one of {texts}")

    async def route_port(self) -> int:
        """The port on which it waits for other nodes."""
        line = await self.line_with("Listening for route connections on")
        found = re.search(r":(\d+)$", line.strip())
        assert found is not None, line
        return int(found[1])


StartNode = Callable[..., Awaitable[Node]]


@pytest.fixture
async def start_node(tmp_path: Path) -> AsyncIterator[StartNode]:
    """Starts a node with a certificate and a password, which knows the nodes at some ports."""
    nodes = CertificateAuthority.make(tmp_path / "node-ca", "Skyway nodes")
    async with AsyncExitStack() as running:

        async def start(name: str, shown: SignedKey, *ports: int, password: str = "right") -> Node:
            folder = tmp_path / name
            folder.mkdir()
            tls = NatsTls(folder / "ca.pem", folder / "node.pem", folder / "key.pem")
            tls.ca_file.write_text(nodes.certificate_pem)
            tls.certificate_file.write_text(shown.certificate_pem)
            tls.key_file.write_text(shown.private_key_pem)
            node = NatsNode(
                name, HOST, -1, -1, folder / "js", cluster_tls=tls, cluster_password=password
            )
            # A cluster has two nodes at least; at ports 7 and 9 nothing listens.
            known = [f"{HOST}:{port}" for port in (*ports, 9, 7)]
            (folder / "nats.conf").write_text(nats_conf(node, nodes=known, accounts_file="a.conf"))
            (folder / "a.conf").write_text(nats_accounts({}, BrokerRules()))
            return Node(await running.enter_async_context(_process(folder)))

        yield start


@asynccontextmanager
async def _process(folder: Path) -> AsyncIterator[asyncio.subprocess.Process]:
    process = await asyncio.create_subprocess_exec(
        NATS_SERVER, "-c", folder / "nats.conf", stderr=asyncio.subprocess.PIPE
    )
    try:
        yield process
    finally:
        process.kill()
        await process.communicate()


def node_key(tmp_path: Path) -> SignedKey:
    """The certificate of a node of the deployment."""
    return CertificateAuthority.load(tmp_path / "node-ca").sign_node((HOST,))


async def test_nodes_of_a_deployment_find_each_other(tmp_path: Path, start_node: StartNode) -> None:
    first = await start_node("first", node_key(tmp_path))
    await start_node("second", node_key(tmp_path), await first.route_port())

    assert LET_IN in await first.line_with(LET_IN, HANDSHAKE_FAILED, WRONG_PASSWORD)


async def test_who_has_a_drones_certificate_is_let_in_by_no_node(
    tmp_path: Path, start_node: StartNode
) -> None:
    drone = CertificateAuthority.make(tmp_path / "drone-ca").sign_drone("drn_1")
    node = await start_node("node", node_key(tmp_path))
    await start_node("thief", drone, await node.route_port())

    assert HANDSHAKE_FAILED in await node.line_with(LET_IN, HANDSHAKE_FAILED)


async def test_a_drones_certificate_is_of_an_unknown_authority_for_nodes(
    tmp_path: Path, start_node: StartNode
) -> None:
    """A node as thief does not even show it; this client does."""
    drone = CertificateAuthority.make(tmp_path / "drone-ca").sign_drone("drn_1")
    (tmp_path / "both.pem").write_text(drone.certificate_pem + drone.private_key_pem)
    shown = ssl.create_default_context(cafile=str(tmp_path / "node-ca" / "ca.pem"))
    shown.load_cert_chain(tmp_path / "both.pem")
    node = await start_node("node", node_key(tmp_path))

    await asyncio.to_thread(_connect, await node.route_port(), shown)

    assert "unknown authority" in await node.line_with(LET_IN, HANDSHAKE_FAILED)


def _connect(port: int, shown: ssl.SSLContext) -> None:
    """Begin TLS like a node, and wait until the other side ends the connection."""
    with (
        suppress(ssl.SSLError, ConnectionError),
        socket.create_connection((HOST, port), timeout=30) as raw,
        shown.wrap_socket(raw, server_hostname=HOST) as encrypted,
    ):
        encrypted.recv(1)


async def test_a_node_without_the_password_of_the_cluster_is_not_let_in(
    tmp_path: Path, start_node: StartNode
) -> None:
    node = await start_node("node", node_key(tmp_path))
    await start_node("other", node_key(tmp_path), await node.route_port(), password="wrong")

    while LET_IN in (line := await node.line_with(LET_IN, WRONG_PASSWORD)):
        pass
    assert WRONG_PASSWORD in line
