"""A node of NATS for tests, run by the script that runs it in a container."""

import asyncio
import sys
from pathlib import Path
from typing import Final

from skyway.broker_setup.nats import NatsNode, nats_conf
from skyway.broker_setup.nats_accounts import hash_for_nats, nats_accounts
from skyway.broker_setup.private_file import write_private
from skyway.contracts.broker_rules import BrokerRules

NATS_SERVER: Final = Path(sys.executable).with_name("nats-server")


class NatsAlone:
    """A node of NATS that runs alone."""

    sends_will_of_replaced = False

    def __init__(self, folder: Path, *, port: int) -> None:
        self.port = self.service_port = port
        self._accounts = folder / "nats_accounts.conf"
        self._configuration = folder / "nats.conf"
        self._hashes: dict[str, str] = {}
        self._process: asyncio.subprocess.Process | None = None
        node = NatsNode("node", "127.0.0.1", self.port, 0, folder / "jetstream")
        conf = nats_conf(node, nodes=(), accounts_file=self._accounts.name)
        self._configuration.write_text(conf)

    async def start(self) -> None:
        self._process = await asyncio.create_subprocess_exec(
            *("sh", "deploy/nats/start.sh", self._configuration, self._accounts, NATS_SERVER),
            stderr=asyncio.subprocess.DEVNULL,
        )

    async def stop(self) -> None:
        if self._process is not None:
            self._process.terminate()
            await self._process.wait()
            self._process = None

    async def set_accounts(self, names: tuple[str, ...]) -> None:
        self._hashes = {name: self._hashes.get(name) or hash_for_nats(name) for name in names}
        write_private(self._accounts, nats_accounts(self._hashes, BrokerRules()))
