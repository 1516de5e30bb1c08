"""The processes of a run: which belong to a target, and how they are ended, stopped and started."""

import os
import signal
from collections.abc import Iterable, Mapping
from contextlib import suppress

from skyway_lab.benchmarks.load.cpu import with_descendants
from skyway_lab.benchmarks.load.servers import Server

from skyway.cli.system.supervisor import Child, Supervisor

#: Replicas are called `gateway 1`, `gateway 2`; drones' processes `agent 0`, `agent 1`.
_REPLICATED = ("gateway", "composition")


class KeptProcesses(Supervisor):
    """A supervisor that remembers its children, so that an ended child can be started again."""

    def __init__(self) -> None:
        super().__init__()
        self._children: dict[str, Child] = {}

    def start(self, child: Child) -> None:
        """Start this child and keep it running."""
        self._children[child.name] = child
        super().start(child)

    def start_again(self, name: str) -> None:
        """Start a child that was ended, and keep it running."""
        super().start(self._children[name])

    @property
    def names(self) -> list[str]:
        """All children, in the order in which they were started first."""
        return list(self._children)


class Processes:
    """All processes by target: supervised children, and servers that nobody restarts."""

    def __init__(self, children: KeptProcesses, servers: Mapping[str, Server]) -> None:
        self._children = children
        self._servers = servers

    def names(self, target: str) -> list[str]:
        """The processes of a target: `everything`, `drones`, `one gateway`, `gateway`, ..."""
        names = [*self._children.names, *self._servers]
        match target:
            case "everything":
                return names
            case "drones":
                return [name for name in names if name.startswith("agent ")]
            case "broker":
                return [name for name in names if name in ("broker", "mosquitto")]
        service = target.removeprefix("one ")
        found = [name for name in names if name == service or name.startswith(f"{service} ")]
        return found[:1] if service != target else found

    def pids(self, target: str) -> list[int]:
        """The process ids of a target, with those of the processes that they started."""
        return [pid for name in self.names(target) for pid in self._pids(name)]

    def freeze(self, target: str) -> list[int]:
        """Stop all processes of a target with SIGSTOP; returns their ids."""
        return _signalled(self.pids(target), signal.SIGSTOP)

    def thaw(self, pids: Iterable[int]) -> None:
        """Let frozen processes go on."""
        _signalled(pids, signal.SIGCONT)

    def kill(self, target: str) -> None:
        """Kill all processes of a target; supervised ones start again by themselves."""
        for name in self.names(target):
            if name in self._servers:
                self._servers[name].kill()
            else:
                _signalled(self._pids(name), signal.SIGKILL)

    async def keep_away(self, target: str) -> None:
        """Kill all processes of a target, and let none of them start again."""
        self.kill(target)
        for name in self.names(target):
            if name not in self._servers:
                await self._children.stop(name)

    def bring_back(self, target: str) -> None:
        """Start the processes of a target that are not running."""
        for name in self.names(target):
            if name not in self._servers:
                self._children.start_again(name)
        self.restart_servers(target)

    def restart_servers(self, target: str) -> None:
        """Start the servers of a target that are not running."""
        for name in self.names(target):
            if name in self._servers and not self._servers[name].pids:
                self._servers[name].start()

    def _pids(self, name: str) -> list[int]:
        if name in self._servers:
            return self._servers[name].pids
        pid = self._children.pid(name)
        return [] if pid is None else list(with_descendants([pid]))


def _signalled(pids: Iterable[int], number: signal.Signals) -> list[int]:
    """Send a signal to these processes; returns those that were still there."""
    reached = []
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, number)
            reached.append(pid)
    return reached
