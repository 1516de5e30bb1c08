"""Fixtures for all tests: a temporary PostgreSQL server, and new databases on both dialects."""

import asyncio
import copy
import gc
import importlib
import json
import os
import pwd
import secrets
import shutil
import signal
import subprocess
import tempfile
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import asyncpg
import pytest
from hypothesis import HealthCheck, settings
from sqlalchemy import Engine, event

from skyway.runtime.clock import ManualClock
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.migrations import migrate
from tests.lanes import LaneScheduling, rank
from tests.shared_statements import share_statements

#: Data files that tests in several folders read.
_DATA = Path(__file__).parent / "data"
_DIALECTS = ("sqlite", pytest.param("postgresql", marks=pytest.mark.integration))
#: The fixtures that make a database.
_DATABASES = {"database_url", "migrated_url", "sqlite_url"}
#: How many workers run tests; set by xdist.
_COUNT = "PYTEST_XDIST_WORKER_COUNT"
_BINARIES = ("initdb", "pg_ctl", "postgres")
#: A shell script that waits until its input closes, then stops the cluster and removes its folder.
_REAP = 'cat; "$1" -D "$2" -w -m immediate stop; rm -rf "$3"'
#: PostgreSQL refuses to run as root. When the tests run as root, it runs as one of these users.
_UNPRIVILEGED = ("postgres", "nobody")
#: The data need not survive a crash, and few files are large.
_OPTIONS = (
    "-c listen_addresses='' -c unix_socket_directories={folder} -c fsync=off"
    " -c full_page_writes=off -c wal_level=minimal -c max_wal_senders=0 -c max_wal_size=64MB"
    " -c autovacuum=off -c max_connections=200 -c shared_buffers=16MB"
)
#: A folder in memory, where copying a database takes a tenth of the time, and the room it needs.
_MEMORY = Path("/dev/shm")
_ROOM_BYTES = 1 << 30

# Every run has the same examples, and no example fails because the machine is busy.
settings.register_profile(
    "skyway", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("skyway")


# Nearly all that is imported from now on stays.
gc.set_threshold(100_000)


def pytest_configure() -> None:
    """Make temporary folders in memory: deleting ten thousand files from a disk takes long.

    All engines share their compiled statements. Under `nohup` SIGHUP is handled instead of ignored:
    processes that tests start would inherit that it is ignored, and no handler.
    """
    share_statements()
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, lambda *_: None)
    if (memory := _memory()) is not None:
        tempfile.tempdir = str(memory)


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Iterator[None]:
    """Import the test files, each worker beginning with others.

    Rewriting the assertions of a file takes longer than importing the file, and pytest keeps the
    result beside it. In a new clone all workers would rewrite all files at the same time.
    """
    worker, workers = os.environ.get("PYTEST_XDIST_WORKER"), os.environ.get(_COUNT)
    if worker is not None and workers is not None and session.config.args == ["tests"]:
        files = sorted((_DATA.parent).rglob("test_*.py"))
        first = len(files) * int(worker.removeprefix("gw")) // int(workers)
        for file in files[first:] + files[:first]:
            _import_test(file)
    yield


def _import_test(file: Path) -> None:
    """Import a test file under the name that pytest gives it. Collecting reports what it raises."""
    name = ".".join(file.relative_to(_DATA.parents[1]).with_suffix("").parts)
    with suppress(Exception, pytest.skip.Exception):
        importlib.import_module(name)


def pytest_collection_finish() -> None:
    """Collect garbage rarely and skip all imported modules; this saves a tenth of a run's time."""
    gc.freeze()
    gc.set_threshold(10_000)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that use a database, and sort: those that take longest begin first."""
    for item in items:
        if not _DATABASES.isdisjoint(getattr(item, "fixturenames", ())):
            item.add_marker("sql")
    items[:] = sorted((item for item in items if _is_on_its_database(item)), key=rank)


def _is_on_its_database(item: pytest.Item) -> bool:
    """Whether a test runs on this database, as its closest `databases` mark says."""
    mark, case = item.get_closest_marker("databases"), getattr(item, "callspec", None)
    dialect = case and case.params.get("migrated_url", case.params.get("database_url"))
    return mark is None or dialect is None or dialect in mark.args


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> LaneScheduling:
    """Use this scheduler for every value of `--dist`."""
    return LaneScheduling(config, log)


class Server:
    """A temporary PostgreSQL cluster. One session creates and drops all databases."""

    def __init__(self, folder: Path, aside: asyncio.Runner) -> None:
        self._url = f"postgresql://skyway@/{{name}}?host={folder}"
        self._aside = aside
        self._session = aside.run(asyncpg.connect(self.url("postgres")))
        # Before version 15, copying files was the only strategy and could not be named.
        has_strategies = self._session.get_server_version().major >= 15
        self._by_file = "STRATEGY file_copy" if has_strategies else ""

    def url(self, name: str) -> str:
        """The URL of a database."""
        return self._url.format(name=name)

    def create(self, name: str, *, template: str = "template1") -> None:
        """Create a database as a copy of another."""
        self._execute(f"CREATE DATABASE {name} TEMPLATE {template} {self._by_file}")

    def drop(self, name: str) -> None:
        """Drop a database, even while clients are connected to it."""
        self._execute(f"DROP DATABASE {name} WITH (FORCE)")

    def close(self) -> None:
        """End the session."""
        self._aside.run(self._session.close())

    def _execute(self, statement: str) -> None:
        self._aside.run(self._session.execute(statement))


@pytest.fixture(scope="session")
def aside() -> Iterator[asyncio.Runner]:
    """An event loop for resources that live longer than the loop of one test."""
    # With a loop factory, the runner does not become the current loop of the thread.
    with asyncio.Runner(loop_factory=asyncio.new_event_loop) as runner:
        yield runner


@pytest.fixture(scope="session")
def postgresql_server(aside: asyncio.Runner) -> Iterator[Server]:
    """An empty PostgreSQL cluster that lives as long as the test session.

    The server listens on a socket in its own folder.
    """
    binaries = _postgresql_binaries()
    if binaries is None:
        pytest.skip("PostgreSQL is not installed (no initdb on PATH or in /usr/lib/postgresql)")
    # A socket's path has at most about 100 characters, so pytest's deep folders are too long.
    folder = Path(tempfile.mkdtemp(prefix="skyway-pg-"))
    data = folder / "data"
    user = unprivileged_user()
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

    # When pytest ends in any way, its end of this pipe closes and the cluster stops.
    with start("sh", "-c", _REAP, "sh", binaries / "pg_ctl", data, folder), log:
        run(binaries / "initdb", "-D", data, "-U", "skyway", "-A", "trust", "-N", "-E", "UTF8")
        options = _OPTIONS.format(folder=folder)
        run(binaries / "pg_ctl", "-D", data, "-w", "-l", folder / "log", "-o", options, "start")
        server = Server(folder, aside)
        yield server
        server.close()


def _memory() -> Path | None:
    """A folder in memory; None if there is none or it has too little room."""
    has_room = _MEMORY.is_dir() and shutil.disk_usage(_MEMORY).free >= _ROOM_BYTES
    return _MEMORY if has_room else None


def _postgresql_binaries() -> Path | None:
    on_path = shutil.which("initdb")
    folders = [Path(on_path).resolve().parent] if on_path else []
    folders += sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    complete = (dir_ for dir_ in folders if all((dir_ / name).exists() for name in _BINARIES))
    return next(complete, None)


def unprivileged_user() -> pwd.struct_passwd | None:
    """Who runs what refuses to run as root; None when the tests do not run as root."""
    if os.geteuid() != 0:
        return None
    users = {user.pw_name: user for user in pwd.getpwall()}
    return next(users[name] for name in _UNPRIVILEGED if name in users)


class Templates:
    """Databases with a service's tables: migrated once, then copied, because that is faster."""

    def __init__(self, folder: Path, aside: asyncio.Runner) -> None:
        self._folder = folder
        self._aside = aside
        self._on_postgresql: set[str] = set()

    def on_sqlite(self, package: str) -> Path:
        """The SQLite file with the tables of this package, for copying."""
        template = self._folder / f"{package}.db"
        if not template.exists():
            self._aside.run(migrate(f"sqlite:///{template}", package))
        return template

    def on_postgresql(self, server: Server, package: str) -> str:
        """The name of the database with the tables of this package, for copying."""
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
    """A fleet clock that stands still at a fixed moment until a test advances it."""
    return ManualClock(datetime(2026, 3, 1, 12, tzinfo=UTC))


@contextmanager
def _copied(server: Server, template: str) -> Iterator[str]:
    """The URL of a copy of a database. The copy is dropped when the block ends."""
    name = f"t_{secrets.token_hex(6)}"
    server.create(name, template=template)
    try:
        yield server.url(name)
    finally:
        server.drop(name)


@dataclass(frozen=True, slots=True)
class BadProblem:
    """A composition problem with one fault, the field at fault, and words of the error message."""

    name: str
    document: dict[str, Any]
    field: str
    message: str


@pytest.fixture(scope="session")
def good_problem() -> dict[str, Any]:
    """A valid composition problem that has every field."""
    document: dict[str, Any] = json.loads((_DATA / "good_problem.json").read_text())
    return document


@pytest.fixture(scope="session")
def bad_problems(good_problem: dict[str, Any]) -> tuple[BadProblem, ...]:
    """Copies of the good problem, each with one field made wrong."""
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
    return BadProblem(name, document, fault.get("field", fault["path"]), fault["message"])


@pytest.fixture
def statements() -> Callable[[], AbstractContextManager[list[str]]]:
    """Records the statements that SQLAlchemy executes in a block; an executemany counts once."""
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
