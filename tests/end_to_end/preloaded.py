"""Processes that start soon: copies of one process that has already imported all of Skyway.

Starting a system otherwise takes seven processor seconds, nearly all of them for imports. A copy
runs `python -m MODULE` as a process of its own: with its own arguments, environment, files, folder
and session, and as a child of the process that started it. Only the imports have happened before.

Stories that start the real commands stay: test_demo.py, test_small_world.py, test_chaos.py and
test_hostile.py.
"""

import atexit
import ctypes
import gc
import importlib
import inspect
import io
import json
import os
import runpy
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Final, NoReturn

#: What every copy has imported.
_IMPORTED: Final = (
    "skyway_gateway.app",
    "skyway_gateway.verify.rules",
    "skyway_composition.app",
    "skyway_composition.verify.rules",
    "skyway_provider_registry.app",
    "skyway_provider_registry.verify",
    "skyway_broker.hardened",
    "skyway.cli.up",
    "skyway.cli.system.running_system",
    "skyway.runtime.http.serving",
    "skyway.runtime.sql.migrations",
)

#: This module starts processes, which are copies too.
_STARTER: Final = "skyway.cli"
_MODULES: Final = (
    _STARTER,
    "skyway_gateway",
    "skyway_composition",
    "skyway_provider_registry",
    "skyway_broker",
)

#: Room for the command line of a copy, which `LocalSystem.pid_of` reads.
_COMMAND_LINE_BYTES: Final = 4096
_LONGEST_REQUEST_BYTES: Final = 1 << 17
_MOST_FILES: Final = 32

#: Of prctl(2): the processes that a child leaves behind become children of this process.
_ADOPT_ORPHANS: Final = 36


@dataclass(frozen=True, slots=True)
class _Request:
    """A process to start."""

    #: The module and its arguments.
    command: list[str]
    environment: dict[str, str]
    folder: str
    #: The numbers that the passed files have in the new process.
    files: list[int]
    starts_session: bool
    #: Which permissions new files do not get: a child has it from its parent.
    umask: int


class Source:
    """A process that makes copies of itself, and this process's connection to it."""

    def __init__(self, requests: socket.socket) -> None:
        self._requests = requests
        # The copies that are asked for at a time by different threads come one after another.
        self._lock = threading.Lock()

    def start(self, request: _Request, files: list[int]) -> int:
        """Start a copy as a child of this process; its id."""
        with self._lock:
            _adopt_orphans(True)
            try:
                socket.send_fds(self._requests, [json.dumps(asdict(request)).encode()], files)
                return int(self._requests.recv(_LONGEST_REQUEST_BYTES))
            finally:
                _adopt_orphans(False)

    def close(self) -> None:
        """Let the process end."""
        self._requests.close()


@cache
def _source() -> Source:
    """The first process of all copies; it ends before this process."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    command = [sys.executable, "-m", __name__, str(theirs.fileno()), "-" * _COMMAND_LINE_BYTES]
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, env=environment, pass_fds=[theirs.fileno()]
    )
    theirs.close()
    source = Source(ours)

    def end() -> None:
        source.close()
        process.wait()

    atexit.register(end)
    return source


class PreloadedProcess(subprocess.Popen[Any]):  # bytes or text, as the caller asks
    """A process as `subprocess.Popen` starts it, but a copy if it runs a module of Skyway."""

    #: Where copies come from, in a process that is a copy.
    inherited: ClassVar[Source | None] = None

    def _execute_child(self, *given: Any) -> None:  # as in subprocess.Popen
        """Start a copy instead of a programme."""
        start = super()._execute_child  # type: ignore[misc]  # private in subprocess
        of = inspect.signature(start).bind(*given).arguments
        command = [os.fspath(part) for part in of["args"]]
        if command[:2] != [sys.executable, "-m"] or command[2] not in _MODULES:
            start(*given)
            return
        ends = (of["p2cread"], of["c2pwrite"], of["errwrite"])
        standard = [number if end == -1 else end for number, end in enumerate(ends)]
        environment = os.environ if of["env"] is None else of["env"]
        request = _Request(
            command=command[2:],
            environment=dict(environment),
            folder=os.fspath(of["cwd"] or Path.cwd()),
            files=[0, 1, 2, *of["pass_fds"]],
            starts_session=of["start_new_session"],
            umask=_umask() if of["umask"] == -1 else of["umask"],
        )
        source = self.inherited or _source()
        self.pid = source.start(request, [*standard, *of["pass_fds"]])
        self._child_created = True
        self._close_pipe_fds(  # type: ignore[attr-defined]  # private in subprocess
            *(of[end] for end in ("p2cread", "p2cwrite", "c2pread", "c2pwrite")),
            *(of[end] for end in ("errread", "errwrite")),
        )


def run_preloaded(
    command: list[str], *, environment: Mapping[str, str], timeout_s: float
) -> subprocess.CompletedProcess[str]:
    """What a command of Skyway prints, and its exit code."""
    pipe = subprocess.PIPE
    with PreloadedProcess(command, env=environment, stdout=pipe, stderr=pipe, text=True) as process:
        try:
            output, errors = process.communicate(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            process.kill()
            raise
    return subprocess.CompletedProcess(command, process.returncode, output, errors)


def main() -> NoReturn:
    """Import everything, then become what is asked for in each copy; ends with the asker."""
    requests = socket.socket(fileno=int(sys.argv[1]))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name in _IMPORTED:
        importlib.import_module(name)
    # The planner too is loaded only once.
    importlib.import_module("skyway.planner.warm").warm()
    assert threading.active_count() == 1, "a copy of a process with threads may stand still"
    gc.collect()
    gc.freeze()
    copies(requests)


def copies(requests: socket.socket) -> NoReturn:
    """Make a copy for each request, until the other end is closed."""
    while True:
        content, files, _, _ = socket.recv_fds(requests, _LONGEST_REQUEST_BYTES, _MOST_FILES)
        if not content:
            os._exit(0)
        read_end, write_end = os.pipe()
        # The copy's parent ends before the answer, so that the asker adopts the copy.
        parent = os.fork()
        if parent == 0:
            pid = os.fork()
            if pid == 0:
                _become(_Request(**json.loads(content)), files)
            os.write(write_end, str(pid).encode())
            os._exit(0)
        os.waitpid(parent, 0)
        requests.send(os.read(read_end, 100))
        for each in (read_end, write_end, *files):
            os.close(each)


def _become(request: _Request, files: list[int]) -> NoReturn:
    """Run the module that is asked for, as `python -m` does."""
    if request.starts_session:
        os.setsid()
    _place(files, request.files)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.chdir(request.folder)
    os.umask(request.umask)
    os.environ.clear()
    os.environ.update(request.environment)
    _open_standard_files()
    _show(("python", "-m", *request.command))
    module, *arguments = request.command
    if module == _STARTER:
        _start_copies()
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)
    sys.exit(0)


def _start_copies() -> None:
    """Let this process start copies of itself as it is now."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    if os.fork() == 0:
        ours.close()
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        _show(("python", "-m", __name__))
        copies(theirs)
    theirs.close()
    PreloadedProcess.inherited = Source(ours)
    # asyncio starts its processes with this class too.
    subprocess.Popen = PreloadedProcess  # type: ignore[misc]


def _place(files: list[int], numbers: list[int]) -> None:
    """Give the files these numbers, and close all others."""
    above = 1 + max((*files, *numbers))
    for number, file in enumerate(files):
        os.dup2(file, above + number)
    for offset, number in enumerate(numbers):
        os.dup2(above + offset, number)
    first = 0
    for number in (*sorted(numbers), os.sysconf("SC_OPEN_MAX")):
        if first < number:
            os.closerange(first, number)
        first = number + 1


def _open_standard_files() -> None:
    """Open standard input, output and errors anew, as Python does when it starts."""
    sys.stdin = sys.__stdin__ = open(0, closefd=False)  # type: ignore[misc]  # noqa: SIM115
    for name, number, errors in (("stdout", 1, "strict"), ("stderr", 2, "backslashreplace")):
        binary = open(number, "wb", closefd=False)  # noqa: SIM115
        by_line = number == 2 or os.isatty(number)
        text = io.TextIOWrapper(binary, errors=errors, line_buffering=by_line)
        setattr(sys, name, text)
        setattr(sys, f"__{name}__", text)


def _show(command: tuple[str, ...]) -> None:
    """Make this the command line that other processes read."""
    fields = Path("/proc/self/stat").read_text().rpartition(")")[2].split()
    # Fields 48 and 49 of proc(5); the first one here is field 3.
    start, end = int(fields[45]), int(fields[46])
    text = "\0".join(command).encode()
    ctypes.memmove(start, text[: end - start - 1].ljust(end - start, b"\0"), end - start)


def _umask() -> int:
    """The umask of this process; os.umask would change it for a moment in all threads."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1], 8) for line in lines if line.startswith("Umask:"))


def _adopt_orphans(adopts: bool) -> None:
    """Whether processes whose parents end become children of this process."""
    ctypes.CDLL(None, use_errno=True).prctl(_ADOPT_ORPHANS, int(adopts), 0, 0, 0)


if __name__ == "__main__":
    main()
