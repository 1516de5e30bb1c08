"""Fixtures for all tests: a throw-away PostgreSQL, and a new database on either dialect."""

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
from contextlib import AbstractContextManager, asynccontextmanager, contextmanager
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
from skyway.runtime.database import Database
from skyway.runtime.migrations import migrate

#: Tables that tests in several folders read.
_DATA = Path(__file__).parent / "data"
_DIALECTS = ("sqlite", pytest.param("postgresql", marks=pytest.mark.integration))
_BINARIES = ("initdb", "pg_ctl", "postgres")
#: Waits for its input to close, then stops the cluster and removes its folder.
_REAP = 'cat; "$1" -D "$2" -w -m immediate stop; rm -rf "$3"'
#: Whom PostgreSQL runs as when the tests run as root, which it refuses to be.
_UNPRIVILEGED = ("postgres", "nobody")
_OPTIONS = (
    "-c listen_addresses='' -c unix_socket_directories={folder} -c fsync=off"
    " -c max_connections=200 -c shared_buffers=16MB"
)

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


@pytest.fixture(scope="session")
def postgresql_server() -> Iterator[str]:
    """The URL of an empty PostgreSQL cluster that lives as long as the tests do.

    It listens on a socket in a folder of its own; its user may create databases.
    """
    binaries = _postgresql_binaries()
    if binaries is None:
        pytest.skip("PostgreSQL is not installed (no initdb on PATH or in /usr/lib/postgresql)")
    # A socket's path may have about 100 characters, so not in pytest's deep folders.
    folder = Path(tempfile.mkdtemp(prefix="skyway-pg-"))
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
        yield f"postgresql://skyway@/postgres?host={folder}"


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

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._on_postgresql: set[str] = set()

    async def copy_to(self, path: Path, package: str) -> None:
        """A SQLite file with the tables of this package."""
        template = self._folder / f"{package}.db"
        if not template.exists():
            await migrate(f"sqlite:///{template}", package)
        shutil.copy(template, path)

    async def on_postgresql(self, server: str, package: str) -> str:
        """The name of the server's database with the tables of this package, to be copied."""
        name = f"template_{package}"
        if name not in self._on_postgresql:
            await _on_server(server, f"CREATE DATABASE {name}")
            await migrate(server.replace("/postgres?", f"/{name}?"), package)
            self._on_postgresql.add(name)
        return name


@pytest.fixture(scope="session")
def templates(tmp_path_factory: pytest.TempPathFactory) -> Templates:
    """One migration of each service and dialect."""
    return Templates(tmp_path_factory.mktemp("templates"))


@pytest.fixture(params=_DIALECTS)
async def database_url(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[str]:
    """The URL of a new, empty database, once on SQLite and once on PostgreSQL."""
    if request.param == "sqlite":
        yield f"sqlite:///{tmp_path}/service.db"
        return
    async with _on_postgresql(request.getfixturevalue("postgresql_server"), "template1") as url:
        yield url


@pytest.fixture(params=_DIALECTS)
async def migrated_url(
    request: pytest.FixtureRequest, tmp_path: Path, templates: Templates, package: str
) -> AsyncIterator[str]:
    """The URL of a new database with the tables of the folder's `package`, on both dialects."""
    if request.param == "sqlite":
        await templates.copy_to(tmp_path / "service.db", package)
        yield f"sqlite:///{tmp_path}/service.db"
        return
    server = request.getfixturevalue("postgresql_server")
    template = await templates.on_postgresql(server, package)
    async with _on_postgresql(server, template) as url:
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


@asynccontextmanager
async def _on_postgresql(server: str, template: str) -> AsyncIterator[str]:
    """The URL of a copy of a database, for as long as the block lasts."""
    name = f"t_{secrets.token_hex(6)}"
    await _on_server(server, f"CREATE DATABASE {name} TEMPLATE {template}")
    try:
        yield server.replace("/postgres?", f"/{name}?")
    finally:
        await _on_server(server, f"DROP DATABASE {name} WITH (FORCE)")


async def _on_server(url: str, statement: str) -> None:
    connection = await asyncpg.connect(url)
    try:
        await connection.execute(statement)
    finally:
        await connection.close()


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
