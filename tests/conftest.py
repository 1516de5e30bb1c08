"""Fixtures for all tests: a throw-away PostgreSQL, and a new database on either dialect."""

import asyncio
import copy
import gc
import json
import math
import os
import pwd
import secrets
import shutil
import subprocess
import tempfile
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import asyncpg
import pytest
from hypothesis import HealthCheck, settings
from sqlalchemy import Engine, event
from xdist.scheduler import LoadScopeScheduling

from skyway.runtime.clock import ManualClock
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.migrations import migrate

#: Tables that tests in several folders read.
_DATA = Path(__file__).parent / "data"
_DIALECTS = ("sqlite", pytest.param("postgresql", marks=pytest.mark.integration))
_BINARIES = ("initdb", "pg_ctl", "postgres")
#: Waits for its input to close, then stops the cluster and removes its folder.
_REAP = 'cat; "$1" -D "$2" -w -m immediate stop; rm -rf "$3"'
#: Whom PostgreSQL runs as when the tests run as root, which it refuses to be.
_UNPRIVILEGED = ("postgres", "nobody")
#: Nothing that it is told need outlive the tests, and few of its files are large.
_OPTIONS = (
    "-c listen_addresses='' -c unix_socket_directories={folder} -c fsync=off"
    " -c full_page_writes=off -c wal_level=minimal -c max_wal_senders=0 -c max_wal_size=64MB"
    " -c autovacuum=off -c max_connections=200 -c shared_buffers=16MB"
)
#: Files in memory, where a database is copied in a tenth of the time; how much room that takes.
_MEMORY = Path("/dev/shm")
_ROOM_BYTES = 1 << 30

# The same examples in every run, and none that fails because the machine is busy.
settings.register_profile(
    "skyway", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("skyway")


def pytest_collection_finish() -> None:
    """Collect garbage seldom, and never among what is imported by now: a tenth of a run's time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What starts whole systems comes first, the slowest fleet clocks before all others.

    It mostly waits, and nobody is to wait for it in the end.
    """
    items.sort(key=_begins_after)


def _begins_after(item: pytest.Item) -> float:
    """Whole systems by the rate of their clocks; what has no such clock comes last."""
    if item.get_closest_marker("end_to_end") is None:
        return math.inf
    rate = item.get_closest_marker("fleet_rate")
    return rate.args[0] if rate else 900.0


class TogetherScheduling(LoadScopeScheduling):
    """One worker runs the tests that share a running system, and those of any other file.

    xdist's own groups do not work with this pytest: they want to change a test's id.
    """

    def _split_scope(self, nodeid: str) -> str:
        file, _, name = nodeid.partition("::")
        _, _, system = name.rstrip("]").partition("[")
        return system if "/end_to_end/" in file and system else file


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> TogetherScheduling:
    """Whatever `--dist` says."""
    return TogetherScheduling(config, log)


class Server:
    """A PostgreSQL cluster of the tests' own; one session makes and drops all databases."""

    def __init__(self, folder: Path, aside: asyncio.Runner) -> None:
        self._url = f"postgresql://skyway@/{{name}}?host={folder}"
        self._aside = aside
        self._session = aside.run(asyncpg.connect(self.url("postgres")))
        # Before 15 this was the only way to copy, and had no name.
        has_ways = self._session.get_server_version().major >= 15
        self._by_file = "STRATEGY file_copy" if has_ways else ""

    def url(self, name: str) -> str:
        """The URL of a database."""
        return self._url.format(name=name)

    def create(self, name: str, *, template: str = "template1") -> None:
        """Make a database that is a copy of another."""
        self._execute(f"CREATE DATABASE {name} TEMPLATE {template} {self._by_file}")

    def drop(self, name: str) -> None:
        """Remove a database, whoever is connected to it."""
        self._execute(f"DROP DATABASE {name} WITH (FORCE)")

    def close(self) -> None:
        """End the session."""
        self._aside.run(self._session.close())

    def _execute(self, statement: str) -> None:
        self._aside.run(self._session.execute(statement))


@pytest.fixture(scope="session")
def aside() -> Iterator[asyncio.Runner]:
    """Runs what outlives a test, whose own loop ends with it."""
    # With a factory it does not become the loop of whoever asks for one.
    with asyncio.Runner(loop_factory=asyncio.new_event_loop) as runner:
        yield runner


@pytest.fixture(scope="session")
def postgresql_server(aside: asyncio.Runner) -> Iterator[Server]:
    """An empty PostgreSQL cluster that lives as long as the tests do.

    It listens on a socket in a folder of its own.
    """
    binaries = _postgresql_binaries()
    if binaries is None:
        pytest.skip("PostgreSQL is not installed (no initdb on PATH or in /usr/lib/postgresql)")
    # A socket's path may have about 100 characters, so not in pytest's deep folders.
    folder = Path(tempfile.mkdtemp(prefix="skyway-pg-", dir=_memory()))
    data = folder / "data"
    user = _postgresql_user()
    if user is not None:
        os.chown(folder, user.pw_uid, user.pw_gid)
    log = (folder / "commands.log").open("ab")

    def start(*command: str | Path) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [str(part) for part in command],
            user=None if user is None else user.pw_uid,
            group=None if user is None else user.pw_gid,
            extra_groups=None if user is None else [],
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=log,
            stderr=log,
            start_new_session=True,
        )

    def run(*command: str | Path) -> None:
        with start(*command) as process:
            assert process.wait() == 0, (folder / "commands.log").read_text()

    # However pytest ends, its end of this pipe closes, and the cluster goes.
    with start("sh", "-c", _REAP, "sh", binaries / "pg_ctl", data, folder), log:
        run(binaries / "initdb", "-D", data, "-U", "skyway", "-A", "trust", "-N", "-E", "UTF8")
        options = _OPTIONS.format(folder=folder)
        run(binaries / "pg_ctl", "-D", data, "-w", "-l", folder / "log", "-o", options, "start")
        server = Server(folder, aside)
        yield server
        server.close()


def _memory() -> Path | None:
    """Where files are kept in memory; None if there is no such place, or it may become full."""
    has_room = _MEMORY.is_dir() and shutil.disk_usage(_MEMORY).free >= _ROOM_BYTES
    return _MEMORY if has_room else None


def _postgresql_binaries() -> Path | None:
    on_path = shutil.which("initdb")
    folders = [Path(on_path).resolve().parent] if on_path else []
    folders += sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    complete = (dir_ for dir_ in folders if all((dir_ / name).exists() for name in _BINARIES))
    return next(complete, None)


def _postgresql_user() -> pwd.struct_passwd | None:
    if os.geteuid() != 0:
        return None
    known = {user.pw_name: user for user in pwd.getpwall()}
    return next(known[name] for name in _UNPRIVILEGED if name in known)


class Templates:
    """Databases with a service's tables: migrated once, then copied, which takes far less time."""

    def __init__(self, folder: Path, aside: asyncio.Runner) -> None:
        self._folder = folder
        self._aside = aside
        self._on_postgresql: set[str] = set()

    def on_sqlite(self, package: str) -> Path:
        """The file with the tables of this package, to be copied."""
        template = self._folder / f"{package}.db"
        if not template.exists():
            self._aside.run(migrate(f"sqlite:///{template}", package))
        return template

    def on_postgresql(self, server: Server, package: str) -> str:
        """The name of the server's database with the tables of this package, to be copied."""
        name = f"template_{package}"
        if name not in self._on_postgresql:
            server.create(name)
            self._aside.run(migrate(server.url(name), package))
            self._on_postgresql.add(name)
        return name


@pytest.fixture(scope="session")
def templates(tmp_path_factory: pytest.TempPathFactory, aside: asyncio.Runner) -> Templates:
    """One migration of each service and dialect."""
    return Templates(tmp_path_factory.mktemp("templates"), aside)


@pytest.fixture(params=_DIALECTS)
def database_url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """The URL of a new, empty database, once on SQLite and once on PostgreSQL."""
    if request.param == "sqlite":
        yield f"sqlite:///{tmp_path}/service.db"
        return
    with _copied(request.getfixturevalue("postgresql_server"), "template1") as url:
        yield url


@pytest.fixture
def sqlite_url(tmp_path: Path, templates: Templates, package: str) -> str:
    """The URL of a new SQLite database with the tables of the folder's `package`."""
    path = tmp_path / "service.db"
    shutil.copy(templates.on_sqlite(package), path)
    return f"sqlite:///{path}"


@pytest.fixture(params=_DIALECTS)
def migrated_url(
    request: pytest.FixtureRequest, templates: Templates, package: str
) -> Iterator[str]:
    """The URL of a new database with the tables of the folder's `package`, on both dialects."""
    if request.param == "sqlite":
        yield request.getfixturevalue("sqlite_url")
        return
    server = request.getfixturevalue("postgresql_server")
    with _copied(server, templates.on_postgresql(server, package)) as url:
        yield url


@pytest.fixture
async def database(database_url: str) -> AsyncIterator[Database]:
    """A new, empty database, open."""
    async with Database(database_url) as opened:
        yield opened


@pytest.fixture
def clock() -> ManualClock:
    """A fleet clock that stands still at a known moment until it is advanced."""
    return ManualClock(datetime(2026, 3, 1, 12, tzinfo=UTC))


@contextmanager
def _copied(server: Server, template: str) -> Iterator[str]:
    """The URL of a copy of a database, for as long as the block lasts."""
    name = f"t_{secrets.token_hex(6)}"
    server.create(name, template=template)
    try:
        yield server.url(name)
    finally:
        server.drop(name)


@dataclass(frozen=True, slots=True)
class BadProblem:
    """A composition problem with one fault: the field to be named, and words of the complaint."""

    name: str
    document: dict[str, Any]
    field: str
    told: str


@pytest.fixture(scope="session")
def good_problem() -> dict[str, Any]:
    """A composition problem that has every field, and nothing wrong."""
    document: dict[str, Any] = json.loads((_DATA / "good_problem.json").read_text())
    return document


@pytest.fixture(scope="session")
def bad_problems(good_problem: dict[str, Any]) -> tuple[BadProblem, ...]:
    """The good problem with one field after another made wrong, in every way there is."""
    return tuple(
        _bad_problem(copy.deepcopy(good_problem), json.loads(line))
        for line in (_DATA / "bad_problems.jsonl").read_text().splitlines()
    )


def _bad_problem(document: dict[str, Any], fault: dict[str, Any]) -> BadProblem:
    holder: Any = document
    *parents, last = (int(part) if part.isdecimal() else part for part in fault["path"].split("."))
    for part in parents:
        holder = holder[part]
    if "missing" in fault:
        del holder[last]
    else:
        holder[last] = fault["value"]
    name = f"{fault['path']} = {fault.get('value', 'missing')!r:.40}"
    return BadProblem(name, document, fault.get("field", fault["path"]), fault["told"])


@pytest.fixture
def statements() -> Callable[[], AbstractContextManager[list[str]]]:
    """Collects what SQLAlchemy executes while a block lasts; many rows in one go count once."""
    return _statements


@contextmanager
def _statements() -> Iterator[list[str]]:
    seen: list[str] = []

    def note(_connection: Any, _cursor: Any, statement: str, *_: Any) -> None:
        seen.append(" ".join(statement.split()))

    event.listen(Engine, "before_cursor_execute", note)
    try:
        yield seen
    finally:
        event.remove(Engine, "before_cursor_execute", note)
