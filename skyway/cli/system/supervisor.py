"""Keeps child processes running: starts them, restarts them with back-off, and ends them all."""

import asyncio
import os
import signal
import socket
import time
from collections import deque
from collections.abc import Coroutine, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from skyway.errors import SkywayError

#: So many deaths of one child in so many seconds stop everything (docs/reference/operations.md).
_DEATHS_TO_GIVE_UP = 4
_DEATHS_WITHIN_S = 30.0


class ProcessKeepsDying(SkywayError):
    """A child died too often; the message names the child and its log."""

    def __init__(self, name: str, *, exit_code: int, log: Path) -> None:
        super().__init__(
            f"{name} ended with code {exit_code}, {_DEATHS_TO_GIVE_UP} times within "
            f"{_DEATHS_WITHIN_S:.0f} s; its log is {log}"
        )


@dataclass(frozen=True, slots=True)
class Child:
    """A process to keep running.

    The parent binds `listener`, so connections wait while the process restarts. `gives_way_by` is
    how much nicer the process is than others (nice(1)).
    """

    name: str
    command: Sequence[str]
    log: Path
    environment: Mapping[str, str] = field(default_factory=dict)
    listener: socket.socket | None = None
    gives_way_by: int = 0


class Supervisor:
    """Runs children until its `async with` block ends; they also end when this process is killed.

    `leave_within_s`: how long a child may take after SIGTERM before it is killed.
    """

    def __init__(self, *, leave_within_s: float = 5.0) -> None:
        self._leave_within_s = leave_within_s
        self._processes: dict[str, asyncio.subprocess.Process] = {}
        self._keepers: dict[str, asyncio.Task[None]] = {}
        self._failure: asyncio.Future[None] | None = None
        self._parent_pipe = (-1, -1)

    async def __aenter__(self) -> Self:
        self._failure = asyncio.get_running_loop().create_future()
        self._parent_pipe = os.pipe()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        # In reverse order of their start: drones before services, services before the broker.
        for name in reversed(list(self._keepers)):
            await self.stop(name)
        for end in self._parent_pipe:
            os.close(end)
        if self._failure is not None and not self._failure.done():
            self._failure.cancel()

    def start(self, child: Child) -> None:
        """Start this child and keep it running."""
        self._keepers[child.name] = asyncio.create_task(self._keep(child), name=child.name)

    async def stop(self, name: str) -> None:
        """End this child."""
        keeper = self._keepers.pop(name)
        keeper.cancel()
        with suppress(asyncio.CancelledError):
            await keeper
        process = self._processes.pop(name, None)
        if process is not None and process.returncode is None:
            await _end(process, within_s=self._leave_within_s)

    def pid(self, name: str) -> int | None:
        """The process id of a child; None while it restarts."""
        process = self._processes.get(name)
        return process.pid if process is not None and process.returncode is None else None

    async def failed(self) -> None:
        """Wait until a child keeps dying, and raise `ProcessKeepsDying`."""
        if self._failure is None:
            raise RuntimeError("the supervisor is not entered")
        await asyncio.shield(self._failure)

    async def _keep(self, child: Child) -> None:
        deaths: deque[float] = deque(maxlen=_DEATHS_TO_GIVE_UP)
        while True:
            process = await self._spawn(child)
            self._processes[child.name] = process
            if child.gives_way_by:
                await asyncio.to_thread(give_way, process.pid, by=child.gives_way_by)
            exit_code = await process.wait()
            now = time.monotonic()
            deaths.append(now)
            recent = sum(now - death < _DEATHS_WITHIN_S for death in deaths)
            if recent == _DEATHS_TO_GIVE_UP:
                if self._failure is not None and not self._failure.done():
                    error = ProcessKeepsDying(child.name, exit_code=exit_code, log=child.log)
                    self._failure.set_exception(error)
                return
            await asyncio.sleep(0.05 * 4 ** (recent - 1))

    async def _spawn(self, child: Child) -> asyncio.subprocess.Process:
        parent_fd = self._parent_pipe[0]
        passed = [parent_fd]
        environment = {**os.environ, **child.environment, "SKYWAY_PARENT_FD": str(parent_fd)}
        if child.listener is not None:
            passed.append(child.listener.fileno())
            environment["SKYWAY_SOCKET_FD"] = str(child.listener.fileno())
        with child.log.open("ab") as log:
            return await asyncio.create_subprocess_exec(
                *child.command,
                stdin=asyncio.subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=environment,
                pass_fds=passed,
                # Ctrl-C reaches only the parent, which ends its children in order.
                start_new_session=True,
            )


async def _end(process: asyncio.subprocess.Process, *, within_s: float) -> None:
    with suppress(ProcessLookupError):
        process.send_signal(signal.SIGTERM)
    try:
        async with asyncio.timeout(within_s):
            await process.wait()
    except TimeoutError:
        with suppress(ProcessLookupError):
            process.kill()
        await process.wait()


def listen(host: str, port: int, *, purpose: str) -> socket.socket:
    """A listening socket to pass to a child; port 0 is any free port.

    Raises
    ------
    SkywayError
        The port is in use; the message names the port and its purpose.
    """
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        raise SkywayError(f"port {port} for {purpose} cannot be used: {error.strerror}") from error
    listener.listen(1024)
    return listener


#: How much nicer simulated drones are than the system, in steps of nice(1): where all want the
#: processor they get a third of the time.
SIMULATES: Final = 5

_NICEST: Final = 19
#: Linux changes the niceness of a group at most once in this many seconds, except for root.
_BETWEEN_GROUPS_S: Final = 0.1
_TRIES: Final = 20


def give_way(pid: int, *, by: int) -> None:
    """Make a new process nicer than this one; do nothing where the system has no niceness.

    This needs no privileges, and children of the process inherit it.
    """
    if not hasattr(os, "setpriority"):
        return
    niceness = min(os.getpriority(os.PRIO_PROCESS, 0) + by, _NICEST)
    with suppress(OSError):  # it may have ended, or it may be nicer already
        os.setpriority(os.PRIO_PROCESS, pid, niceness)
        if os.getsid(pid) == pid:
            _give_way_as_group(pid, niceness)


def _give_way_as_group(pid: int, niceness: int) -> None:
    """Make the process's session nicer too.

    With autogroup on, as on most desktops, Linux first shares a processor among sessions. The
    niceness of processes counts only within a session (sched(7)).
    """
    group = Path(f"/proc/{pid}/autogroup")
    for _ in range(_TRIES if group.exists() else 0):
        try:
            group.write_text(str(niceness))
        except BlockingIOError:
            time.sleep(_BETWEEN_GROUPS_S)
        else:
            return


async def first_of(*runners: Coroutine[Any, Any, object]) -> None:
    """Run all until the first ends, cancel the others, and raise what the first raised."""
    tasks = {asyncio.ensure_future(runner) for runner in runners}
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for task in done:
        task.result()
