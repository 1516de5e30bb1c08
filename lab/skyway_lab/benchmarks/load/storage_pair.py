"""The two pairs of database and broker: the embedded one, and servers of our own for the run."""

import os
import shutil
import signal
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from skyway_lab.benchmarks.load.burst import Storage
from skyway_lab.benchmarks.load.servers import (
    Server,
    make_mosquitto,
    make_postgresql,
    postgresql_url,
)

from skyway.cli.data_folder import DataFolder

#: What a shell around the benchmark may have set for another system.
_SETTINGS = ("SKYWAY_DATABASE_URL", "SKYWAY_MQTT_URL", "SKYWAY_MQTT_DRONE_URL")


@contextmanager
def storage_pair(
    storage: Storage, folder: DataFolder, *, postgresql_options: Sequence[str] = ()
) -> Iterator[dict[str, Server]]:
    """Start the servers of this pair and set the environment for it; the servers by name.

    Within the block SIGTERM does the same as Ctrl-C, so all that was started is ended in order.
    """
    with ExitStack() as stack:
        stack.enter_context(_sigterm_interrupts())
        stack.enter_context(_environment_kept())
        for name in _SETTINGS:
            os.environ.pop(name, None)
        servers: dict[str, Server] = {}
        if storage == "production":
            servers["postgresql"] = stack.enter_context(_postgresql(postgresql_options))
            servers["mosquitto"] = make_mosquitto(folder)
            stack.callback(servers["mosquitto"].stop)
        yield servers


@contextmanager
def _sigterm_interrupts() -> Iterator[None]:
    def interrupt(*_: object) -> None:
        # `timeout` sends the signal to all processes, and `python -m skyway_lab` passes it on. A
        # second Ctrl-C would break off what the first one has begun.
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        signal.raise_signal(signal.SIGINT)

    terminated = signal.signal(signal.SIGTERM, interrupt)
    # A program that a script has started in the background ignores Ctrl-C.
    interrupted = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, interrupted)
        signal.signal(signal.SIGTERM, terminated)


@contextmanager
def _environment_kept() -> Iterator[None]:
    before = {name: os.environ.get(name) for name in _SETTINGS}
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def _postgresql(options: Sequence[str]) -> Iterator[Server]:
    # A socket's path may have about 100 characters.
    folder = Path(tempfile.mkdtemp(prefix="skyway-pg-"))
    try:
        server = make_postgresql(folder, options=options)
        try:
            os.environ["SKYWAY_DATABASE_URL"] = postgresql_url(folder)
            yield server
        finally:
            server.stop()
    finally:
        shutil.rmtree(folder)
