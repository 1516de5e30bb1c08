"""Kills a node of three of NATS while instructions are under way, and opens and closes accounts.

`python -m benchmarks nats_failover --drones 300 --runs 3` prints for each run how long clients and
instructions paused, and ends with 1 if an instruction was lost or a closed account got in.
"""

import argparse
import asyncio
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from benchmarks.planner.machine import Machine
from skyway.broker_setup.certificates import CertificateAuthority
from skyway.broker_setup.nats import NatsNode, NatsTls, nats_conf
from skyway.broker_setup.nats_accounts import hash_for_nats, nats_accounts
from skyway.broker_setup.private_file import write_private
from skyway.contracts.broker_rules import BrokerRules
from skyway.contracts.drone_report import Ack
from skyway.contracts.instruction import ReportInstruction
from skyway.contracts.topics import ACKS, INSTRUCTIONS
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt.client import MqttClient

_ROOT: Final = Path(__file__).parents[1]
_SERVER: Final = Path(sys.executable).with_name("nats-server")
_NODES: Final = 3
_PROVIDER: Final = "p"

#: Wall seconds: for the cluster to begin, between two instructions of a drone, and until an
#: instruction without an ack is sent again, as composition does.
_BEGINS_WITHIN_S: Final = 120.0
_EVERY_S: Final = 1.0
_AGAIN_AFTER_S: Final = 2.0
#: Instructions before the kill and after it.
_BEFORE, _AFTER = 5, 15


class Cluster:
    """Three nodes on this machine, each run as in a container; they check their certificates."""

    def __init__(self, folder: Path, drones: Sequence[str]) -> None:
        self._folder = folder
        self._accounts = folder / "accounts.conf"
        self._hashes = {name: hash_for_nats(name) for name in ("composition", *drones)}
        self.close_accounts(())
        tls = _cluster_tls(folder)
        ports = _free_ports(2 * _NODES)
        self._nodes = [
            NatsNode(
                f"node-{number}",
                "127.0.0.1",
                next(ports),
                next(ports),
                folder / str(number),
                cluster_tls=tls,
                cluster_password="failover",
            )
            for number in range(_NODES)
        ]
        self._processes: list[subprocess.Popen[bytes]] = []

    @property
    def url(self) -> str:
        """The addresses of all nodes."""
        return ",".join(f"mqtt+nats://127.0.0.1:{node.mqtt_port}" for node in self._nodes)

    def close_accounts(self, closed: Sequence[str]) -> None:
        """Let these accounts in no more."""
        hashes = {name: each for name, each in self._hashes.items() if name not in closed}
        write_private(self._accounts, nats_accounts(hashes, BrokerRules()))

    def start(self) -> None:
        """Start all nodes."""
        routes = [f"127.0.0.1:{node.cluster_port}" for node in self._nodes]
        for node in self._nodes:
            configuration = self._folder / f"{node.name}.conf"
            text = nats_conf(node, nodes=routes, accounts_file=self._accounts.name)
            configuration.write_text(text)
            command = ("sh", "deploy/nats/start.sh", configuration, self._accounts, _SERVER)
            with (self._folder / f"{node.name}.log").open("wb") as log:
                self._processes.append(
                    subprocess.Popen(
                        command, cwd=_ROOT, stdout=log, stderr=log, start_new_session=True
                    )
                )

    def kill(self, number: int) -> None:
        """End a node as a machine ends that loses its power."""
        with suppress(ProcessLookupError):
            os.killpg(self._processes[number].pid, signal.SIGKILL)
        self._processes[number].wait()

    def stop(self) -> None:
        """End all nodes."""
        for number in range(len(self._processes)):
            self.kill(number)


@dataclass(slots=True)
class Drone:
    """A drone that answers each instruction, and notes which it has done."""

    name: str
    client: MqttClient
    done: list[int] = field(default_factory=list)
    received: int = 0

    async def serve(self) -> None:
        """Answer for ever; what is not acknowledged is answered when it comes again."""
        async for batch in self.client.batches(INSTRUCTIONS(_PROVIDER, self.name)):
            for each in batch:
                self.received += 1
                if each.message.seq not in self.done:
                    self.done.append(each.message.seq)
                with suppress(MqttUnavailable):
                    await self.client.publish(ACKS(_PROVIDER, self.name), _ack(each.message.seq))


@dataclass(slots=True)
class Composition:
    """Sends instructions, and each again until its drone has answered."""

    client: MqttClient
    #: By drone and number: when it was first sent, and after how many seconds its answer came.
    sent_at: dict[tuple[str, int], float] = field(default_factory=dict)
    answered_s: dict[tuple[str, int], float] = field(default_factory=dict)
    _answered: dict[tuple[str, int], asyncio.Event] = field(default_factory=dict)

    async def listen(self) -> None:
        """Note answers for ever."""
        async for batch in self.client.batches(ACKS):
            for each in batch:
                place = each.ids[1], each.message.instruction_seq
                self.answered_s.setdefault(place, time.monotonic() - self.sent_at[place])
                self._answered[place].set()

    async def send(self, drone: str, seq: int) -> None:
        """Return once the drone has answered."""
        self.sent_at[drone, seq] = time.monotonic()
        answered = self._answered[drone, seq] = asyncio.Event()
        while not answered.is_set():
            with suppress(MqttUnavailable):
                await self.client.publish(
                    INSTRUCTIONS(_PROVIDER, drone), _instruction(seq), timeout_s=_AGAIN_AFTER_S
                )
            with suppress(TimeoutError):
                await asyncio.wait_for(answered.wait(), _AGAIN_AFTER_S)


@asynccontextmanager
async def _flying(
    cluster: Cluster, names: Sequence[str]
) -> AsyncIterator[tuple[Composition, list[Drone]]]:
    async with AsyncExitStack() as stack:

        async def enter(name: str) -> MqttClient:
            client = MqttClient(cluster.url, client_id=name, user_name=name, password=name)
            return await stack.enter_async_context(client)

        composition = Composition(await enter("composition"))
        drones = [Drone(name.partition("/")[2], await enter(name)) for name in names]
        async with asyncio.TaskGroup() as tasks:
            serving = [tasks.create_task(each.serve()) for each in drones]
            serving.append(tasks.create_task(composition.listen()))
            async with asyncio.timeout(_BEGINS_WITHIN_S):
                for client in (composition.client, *(each.client for each in drones)):
                    await client.wait_connected()
            yield composition, drones
            for task in serving:
                task.cancel()


async def run(count: int) -> bool:
    """One run; whether nothing was lost and nobody came back."""
    names = [f"{_PROVIDER}/drone-{number}" for number in range(count)]
    with tempfile.TemporaryDirectory(prefix="skyway-nats-") as name:
        cluster = Cluster(Path(name), names)
        try:
            cluster.start()
            async with _flying(cluster, names) as (composition, drones):
                return await _measured(cluster, composition, drones)
        finally:
            cluster.stop()


async def _measured(cluster: Cluster, composition: Composition, drones: list[Drone]) -> bool:
    sending = []
    killed_at = back_s = 0.0
    for seq in range(1, _BEFORE + _AFTER + 1):
        if seq == _BEFORE + 1:
            cluster.kill(0)
            killed_at = time.monotonic()
        sending += [asyncio.create_task(composition.send(each.name, seq)) for each in drones]
        await asyncio.sleep(_EVERY_S)
        if killed_at and not back_s and all(each.client.is_connected for each in drones):
            back_s = time.monotonic() - killed_at
    _, unanswered = await asyncio.wait(sending, timeout=60.0)
    for task in unanswered:
        task.cancel()
    doubled = sum(each.received - len(each.done) for each in drones)
    before = [took for (_, seq), took in composition.answered_s.items() if seq <= _BEFORE]
    after = [took for (_, seq), took in composition.answered_s.items() if seq > _BEFORE]
    closed_s, is_closed = await _close(cluster, drones)
    print(
        f"{len(sending)} instructions, {len(unanswered)} lost, {doubled} came twice and were done "
        f"once; the slowest took {max(before):.2f} s before the kill and {max(after):.1f} s after "
        f"it; all drones connected {back_s:.1f} s after it; a third of the accounts closed: out "
        f"after {closed_s:.2f} s{'' if is_closed else ', BUT NOT ALL'}",
        flush=True,
    )
    return not unanswered and is_closed


async def _close(cluster: Cluster, drones: list[Drone]) -> tuple[float, bool]:
    """After how many seconds a third of all is out at every node, and whether it stays out."""
    closed, others = drones[::3], [each for each in drones if each not in drones[::3]]
    at = time.monotonic()
    cluster.close_accounts([f"{_PROVIDER}/{each.name}" for each in closed])
    with suppress(TimeoutError):
        async with asyncio.timeout(30.0):
            for each in closed:
                await each.client.wait_lost()
    closed_s = time.monotonic() - at
    await asyncio.sleep(_AGAIN_AFTER_S)
    stays_out = not any(each.client.is_connected for each in closed)
    return closed_s, stays_out and all(each.client.is_connected for each in others)


def _cluster_tls(folder: Path) -> NatsTls:
    authority = CertificateAuthority.make(folder / "ca", "Skyway nodes")
    signed = authority.sign_node(("127.0.0.1",))
    files = NatsTls(folder / "ca.pem", folder / "node.pem", folder / "node-key.pem")
    write_private(files.ca_file, authority.certificate_pem)
    write_private(files.certificate_file, signed.certificate_pem)
    write_private(files.key_file, signed.private_key_pem)
    return files


def _free_ports(count: int) -> Iterator[int]:
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return iter(ports)


def _instruction(seq: int) -> ReportInstruction:
    now = datetime.now(UTC)
    return ReportInstruction(
        message_id=f"m{seq}",
        sent_at=now,
        instruction_id=f"i{seq}",
        stream=1,
        seq=seq,
        expires_at=now + timedelta(minutes=5),
        events_after_seq=0,
    )


def _ack(seq: int) -> Ack:
    return Ack(
        message_id=f"a{seq}",
        sent_at=datetime.now(UTC),
        session=1,
        seq=seq,
        instruction_id=f"i{seq}",
        instruction_seq=seq,
        stream=1,
        status="RECEIVED",
    )


def main() -> int:
    """Run as often as asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drones", type=int, default=300)
    parser.add_argument("--runs", type=int, default=3)
    given = parser.parse_args()
    print(f"{Machine.here().as_text()}; {given.drones} drones on {_NODES} nodes of NATS\n")
    results = [asyncio.run(run(given.drones)) for _ in range(given.runs)]
    print(f"{sum(results)} of {len(results)} runs without a loss")
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
