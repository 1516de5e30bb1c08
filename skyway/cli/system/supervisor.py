"""Keeps child processes running: starts them, restarts them with back-off, and ends them all.

An exit code says why a child ended, and whether it is started again.
"""

import asyncio
import os
import signal
import socket
from collections.abc import Awaitable, Callable, Coroutine, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Protocol, Self

from skyway.cli.system.niceness import give_way
from skyway.errors import SkywayError
from skyway.runtime.clock import AnchoredClock, FleetClock, sleep_wall
from skyway.runtime.errors import FOR_GOOD, ExitCode

#: The end of a log in which the last words of a process are.
_LAST_BYTES: Final = 4096


#: Seconds of wall time before the first start after a death, the second, ...; the last for ever.
_PAUSES_S: Final = (0.05, 0.5, 1.0, 2.0, 4.0, 5.0)


#: A process that ran this long had started well: its death is the first one again.
_STARTED_WELL_S: Final = 10.0


_MEANINGS: Final = {
    ExitCode.ENDED: "ended by itself",
    ExitCode.FAILED: "ended by a bug",
    ExitCode.BAD_SETTINGS: "cannot run with these settings",
    ExitCode.NOT_NOW: "lacks a part of the system",
    ExitCode.BAD_DATABASE: "cannot use its database",
}


class ProcessEnded(SkywayError):
    """Another process of Skyway ended by an error; this one ends with the same exit code."""

    def __init__(self, detail: str, *, exit_code: int) -> None:
        super().__init__(detail)
        self.exit_code = ExitCode(exit_code) if exit_code in set(ExitCode) else ExitCode.FAILED


class ProcessCannotRun(ProcessEnded):
    """A child ended for a cause that cannot pass; the message holds the child's own last words."""

    def __init__(self, child: "Child", *, exit_code: int) -> None:
        said = _last_line(child.log)
        detail = f"{child.name} {_cause_of(exit_code)}: {said}; its log is {child.log}"
        super().__init__(detail, exit_code=exit_code)


class Process(Protocol):
    """A running child, as asyncio gives one."""

    @property
    def pid(self) -> int:
        """Its id."""
        ...

    @property
    def returncode(self) -> int | None:
        """Its exit code, -N after signal N; None while it runs."""
        ...

    async def wait(self) -> int:
        """Wait for its end; the exit code."""
        ...

    def send_signal(self, number: int) -> None:
        """Send a signal to it."""
        ...

    def kill(self) -> None:
        """End it with SIGKILL."""
        ...


#: Starts a child that holds this end of the pipe to its parent.
Start = Callable[["Child", int], Awaitable[Process]]


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

    Parameters
    ----------
    say
        Gets one line when a child is started again: why, and when.
    leave_within_s
        How long a child may take after SIGTERM before it is killed.
    start, clock
        How children are started and the time passes; tests have their own.
    """

    def __init__(
        self,
        *,
        say: Callable[[str], None] = lambda _line: None,
        leave_within_s: float = 5.0,
        start: "Start | None" = None,
        clock: FleetClock | None = None,
    ) -> None:
        self._say = say
        self._leave_within_s = leave_within_s
        self._start = start or start_process
        self._clock = clock or AnchoredClock.plain()
        self._processes: dict[str, Process] = {}
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
        """Wait until a child cannot run, and raise `ProcessCannotRun`."""
        if self._failure is None:
            raise RuntimeError("the supervisor is not entered")
        await asyncio.shield(self._failure)

    async def _keep(self, child: Child) -> None:
        """Run the child, and start it again with growing pauses, until its cause cannot pass."""
        restarts = _Restarts()
        while True:
            started_at = self._clock.wall_now()
            cause = await self._run(child)
            if cause is None:
                return
            ran_s = (self._clock.wall_now() - started_at).total_seconds()
            pause_s = restarts.pause_s(ran_s=ran_s)
            if restarts.is_news(cause, pause_s):
                again = "now" if pause_s < 1 else f"in {pause_s:g} s"
                self._say(f"{child.name} {cause}; it starts again {again}. Log: {child.log}")
            await sleep_wall(self._clock, pause_s)

    async def _run(self, child: Child) -> str | None:
        """Run the child once; why it ended, or None when it must not be started again."""
        try:
            process = await self._start(child, self._parent_pipe[0])
        except OSError as error:  # such as: no descriptors, no memory, a full disk for the log
            return f"cannot be started ({error.strerror})"
        self._processes[child.name] = process
        if child.gives_way_by:
            await asyncio.to_thread(give_way, process.pid, by=child.gives_way_by)
        exit_code = await process.wait()
        if exit_code not in FOR_GOOD:
            return _cause_of(exit_code)
        if self._failure is not None and not self._failure.done():
            self._failure.set_exception(ProcessCannotRun(child, exit_code=exit_code))
        return None


async def start_process(child: Child, parent_fd: int) -> asyncio.subprocess.Process:
    """Start a child; it ends when the other end of the pipe `parent_fd` closes."""
    passed = [parent_fd]
    environment = {**os.environ, **child.environment, "SKYWAY_PARENT_FD": str(parent_fd)}
    # Without bytecode a process that was killed would compile everything anew, which takes seconds.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
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


def _last_line(log: Path) -> str:
    """The last line of a log: there a process that cannot run says why."""
    try:
        with log.open("rb") as file:
            file.seek(max(0, log.stat().st_size - _LAST_BYTES))
            lines = file.read().decode(errors="replace").split("\n")
    except OSError as error:
        return f"its log cannot be read ({error.strerror})"
    return next((line for line in reversed(lines) if line.strip()), "without a word")


async def _end(process: Process, *, within_s: float) -> None:
    with suppress(ProcessLookupError):
        process.send_signal(signal.SIGTERM)
    try:
        async with asyncio.timeout(within_s):
            await process.wait()
    except TimeoutError:
        with suppress(ProcessLookupError):
            process.kill()
        await process.wait()


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


@dataclass(slots=True)
class _Restarts:
    """The deaths of one process in a row, and what was said about them."""

    _deaths: int = 0
    _said: tuple[str, float] = ("", 0.0)

    def pause_s(self, *, ran_s: float) -> float:
        """How long to wait now that the process has died after so many seconds."""
        if ran_s >= _STARTED_WELL_S:
            self._deaths, self._said = 0, ("", 0.0)
        pause_s = _PAUSES_S[min(self._deaths, len(_PAUSES_S) - 1)]
        self._deaths += 1
        return pause_s

    def is_news(self, cause: str, pause_s: float) -> bool:
        """Whether to say it: not again while the process keeps dying in the same way."""
        is_news = self._said != (cause, pause_s)
        self._said = (cause, pause_s)
        return is_news


def _cause_of(exit_code: int) -> str:
    """Why a process ended, as a sentence without its subject."""
    if exit_code < 0:
        with suppress(ValueError):
            return f"was ended by {signal.Signals(-exit_code).name}"
    meaning = _MEANINGS.get(ExitCode(exit_code)) if exit_code in set(ExitCode) else None
    return f"{meaning or 'ended'} (exit code {exit_code})"
