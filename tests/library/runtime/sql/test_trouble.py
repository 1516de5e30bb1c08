"""Which errors are trouble of the database, and which rule refused a row."""

import errno
import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import (
    CheckConstraint,
    Column,
    Index,
    Integer,
    MetaData,
    Table,
    Text,
    UniqueConstraint,
    text,
)
from sqlalchemy.exc import DBAPIError, IntegrityError
from sqlalchemy.exc import TimeoutError as NoFreeConnection

from skyway.runtime.errors import DamagedDatabase, RowRefused, ServiceUnavailable
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.trouble import named_trouble, trouble_of_reading, trouble_of_writing

ON_POSTGRESQL = pytest.mark.parametrize(
    "database_url", [pytest.param("postgresql", marks=pytest.mark.integration)], indirect=True
)
ON_SQLITE = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)

STATIONS = Table("stations", MetaData(), Column("name", Text, primary_key=True))


#: Makes one connection read-only for as long as it is open.
READ_ONLY = {
    "sqlite": "PRAGMA query_only = ON",
    "postgresql": "SET SESSION CHARACTERISTICS AS TRANSACTION READ ONLY",
}


class ServerError(Exception):
    """What asyncpg raises, as far as trouble depends on it."""

    def __init__(self, sqlstate: str) -> None:
        super().__init__("something with a secret in it")
        self.sqlstate = sqlstate


def on_postgresql(sqlstate: str) -> Exception:
    return DBAPIError("SELECT 1", None, ServerError(sqlstate))


def on_sqlite(code: int) -> Exception:
    error = sqlite3.OperationalError("what SQLite says")
    error.sqlite_errorcode = code
    return DBAPIError("SELECT 1", None, error)


@pytest.mark.parametrize(
    "error",
    [
        *map(
            on_postgresql,
            # Connections, roles, rollbacks, resources, locks, stops, disks, faults inside.
            ["08000", "08006", "28P01", "3D000", "40001", "40P01", "53100", "53200", "53300"],
        ),
        *map(
            on_postgresql,
            ["55P03", "57014", "57P01", "57P02", "57P03", "58000", "58030", "F0000", "XX000"],
        ),
        *map(on_postgresql, ["25P03", "25P04", "42501", "XX001"]),
        *map(
            on_sqlite,
            [
                sqlite3.SQLITE_BUSY,
                sqlite3.SQLITE_BUSY_SNAPSHOT,
                sqlite3.SQLITE_CANTOPEN,
                sqlite3.SQLITE_CORRUPT,
                sqlite3.SQLITE_FULL,
                sqlite3.SQLITE_IOERR,
                sqlite3.SQLITE_IOERR_WRITE,
                sqlite3.SQLITE_LOCKED,
                sqlite3.SQLITE_NOMEM,
                sqlite3.SQLITE_NOTADB,
                sqlite3.SQLITE_READONLY_CANTINIT,
            ],
        ),
        OSError(errno.EMFILE, "too many open files"),
        ConnectionResetError(errno.ECONNRESET, "reset"),
        TimeoutError(),
        MemoryError(),
        NoFreeConnection("the pool is empty"),
    ],
    ids=repr,
)
def test_trouble_is_unavailable(error: Exception) -> None:
    with (
        pytest.raises(ServiceUnavailable, match="database is unavailable"),
        named_trouble(trouble_of_reading),
    ):
        raise error


@pytest.mark.parametrize(
    "error",
    [
        # Constraints, data, syntax, unknown tables, a statement after an error.
        *map(on_postgresql, ["23505", "23503", "22001", "42601", "42P01", "25P02", "54000"]),
        *map(
            on_sqlite,
            [
                sqlite3.SQLITE_CONSTRAINT_FOREIGNKEY,
                sqlite3.SQLITE_ERROR,
                sqlite3.SQLITE_MISMATCH,
                sqlite3.SQLITE_TOOBIG,
            ],
        ),
        LookupError("a bug"),
    ],
    ids=repr,
)
def test_a_bug_stays_what_it_is(error: Exception) -> None:
    with pytest.raises(type(error)) as raised, named_trouble(trouble_of_writing):
        raise error

    assert raised.value is error


@pytest.mark.parametrize("error", [on_postgresql("25006"), on_sqlite(sqlite3.SQLITE_READONLY)])
def test_a_read_only_database_is_trouble_for_writers_and_a_bug_of_readers(error: Exception) -> None:
    writing, reading = trouble_of_writing(error), trouble_of_reading(error)

    assert (str(writing), reading) == ("database is unavailable: it is read-only now", None)


@pytest.mark.parametrize("error", [on_postgresql("XX002"), on_sqlite(sqlite3.SQLITE_NOTADB)])
def test_damage_is_distinguished_from_trouble_that_passes(error: Exception) -> None:
    assert isinstance(trouble_of_reading(error), DamagedDatabase)


def test_the_detail_names_no_address() -> None:
    trouble = trouble_of_reading(OSError(errno.ECONNREFUSED, "Connect call failed ('10.0.0.1', 1)"))

    assert str(trouble) == "database is unavailable: Connection refused"


@ON_POSTGRESQL
async def test_a_server_that_is_lost_within_a_block_is_unavailable(database: Database) -> None:
    with pytest.raises(ServiceUnavailable, match="the connection failed"):
        async with database.write() as tx:
            await tx.execute(text("SELECT pg_terminate_backend(pg_backend_pid())"))


@ON_SQLITE
async def test_a_full_disk_refuses_a_block_and_the_next_block_goes_on(database: Database) -> None:
    async def add(name: str) -> None:
        async with database.write() as tx:
            await tx.execute(STATIONS.insert(), {"name": name})

    async with database.write() as tx:
        await tx.connection.run_sync(STATIONS.metadata.create_all)
        await tx.execute(text("PRAGMA max_page_count = 10"))
    with pytest.raises(ServiceUnavailable, match="full"):
        await add("x" * 100_000)
    await add("small")

    async with database.read() as connection:
        found = await connection.execute(STATIONS.select())
    assert list(found.scalars()) == ["small"]


def cut_off(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:4096] + bytes(4096))


def overwrite(file: Path) -> None:
    file.write_bytes(b"no database at all, but long enough to look like one" * 100)


def remove(file: Path) -> None:
    shutil.rmtree(file.parent)


@pytest.mark.parametrize(
    ("harm", "trouble"),
    [(cut_off, DamagedDatabase), (overwrite, DamagedDatabase), (remove, ServiceUnavailable)],
)
async def test_a_harmed_file_is_named_when_it_is_opened(
    tmp_path: Path, harm: Callable[[Path], None], trouble: type[ServiceUnavailable]
) -> None:
    file = tmp_path / "folder" / "service.db"
    file.parent.mkdir()
    async with Database(f"sqlite:///{file}") as database, database.write() as tx:
        await tx.connection.run_sync(STATIONS.metadata.create_all)
    harm(file)

    with pytest.raises(ServiceUnavailable) as raised:
        async with Database(f"sqlite:///{file}") as database, database.read() as connection:
            await connection.execute(STATIONS.select())

    assert type(raised.value) is trouble


async def test_a_connection_that_was_opened_read_only_is_replaced(database: Database) -> None:
    async with database.write() as tx:
        await tx.connection.run_sync(STATIONS.metadata.create_all)
        driver: Any = (await tx.connection.get_raw_connection()).driver_connection
    await driver.execute(READ_ONLY[database.dialect])

    async def add(name: str) -> None:
        async with database.write() as tx:
            await tx.execute(STATIONS.insert(), {"name": name})

    with pytest.raises(ServiceUnavailable, match="read-only"):
        await add("early")
    await add("late")

    async with database.read() as connection:
        found = await connection.execute(STATIONS.select())
    assert list(found.scalars()) == ["late"]


METADATA = MetaData()
MISSIONS = Table(
    "missions",
    METADATA,
    Column("id", Text, primary_key=True),
    Column("drone_id", Text),
    Column("state", Text),
    Column("delivery_id", Text),
    Column("attempt", Integer),
    Column("code", Text, unique=True),
    Column("mass_kg", Integer),
    UniqueConstraint("delivery_id", "attempt", name="mission_of_attempt"),
    CheckConstraint("mass_kg >= 0", name="mass_is_positive"),
)
Index(
    "one_mission_per_drone",
    MISSIONS.c.drone_id,
    unique=True,
    sqlite_where=MISSIONS.c.state == "ACTIVE",
    postgresql_where=MISSIONS.c.state == "ACTIVE",
)

TRIGGER = {
    "sqlite": [
        (
            "CREATE TRIGGER no_zero BEFORE INSERT ON missions WHEN NEW.attempt = 0"
            " BEGIN SELECT RAISE(ABORT, 'attempt_taken'); END"
        )
    ],
    "postgresql": [
        (
            "CREATE FUNCTION refuse() RETURNS trigger LANGUAGE plpgsql AS"
            " $$ BEGIN RAISE EXCEPTION 'attempt_taken'; END $$"
        ),
        (
            "CREATE TRIGGER no_zero BEFORE INSERT ON missions FOR EACH ROW"
            " WHEN (NEW.attempt = 0) EXECUTE FUNCTION refuse()"
        ),
    ],
}


@pytest.fixture
async def db(database: Database) -> Database:
    async with database.write() as tx:
        await tx.connection.run_sync(METADATA.create_all)
        for statement in TRIGGER[tx.dialect]:
            await tx.execute(text(statement))
        first = {"id": "m1", "drone_id": "d1", "state": "ACTIVE", "delivery_id": "y1"}
        await tx.execute(MISSIONS.insert(), {**first, "attempt": 1, "code": "c1"})
    return database


@pytest.mark.parametrize(
    ("row", "constraint"),
    [
        ({"id": "m1"}, "missions_pkey"),
        ({"id": "m2", "drone_id": "d1", "state": "ACTIVE"}, "one_mission_per_drone"),
        ({"id": "m2", "delivery_id": "y1", "attempt": 1}, "mission_of_attempt"),
        ({"id": "m2", "code": "c1"}, "missions_code_key"),
        ({"id": "m2", "attempt": 0}, "attempt_taken"),
    ],
)
async def test_a_refused_row_names_its_rule(
    db: Database, row: dict[str, object], constraint: str
) -> None:
    with pytest.raises(RowRefused) as refused:
        async with db.write() as tx:
            await tx.execute(MISSIONS.insert(), row)

    assert refused.value.constraint == constraint


@pytest.mark.parametrize("row", [{"id": None}, {"id": "m2", "mass_kg": -1}])
async def test_a_row_that_breaks_another_rule_is_a_fault_of_ours(
    db: Database, row: dict[str, object]
) -> None:
    with pytest.raises(IntegrityError):
        async with db.write() as tx:
            await tx.execute(MISSIONS.insert().values(row))


#: SQLite has no exclusion constraints: triggers stand in for them.


@ON_POSTGRESQL
async def test_an_exclusion_constraint_names_itself(db: Database) -> None:
    async with db.write() as tx:
        await tx.execute(
            text(
                "CREATE TABLE holds (during int8range,"
                " CONSTRAINT pad_taken EXCLUDE USING gist (during WITH &&))"
            )
        )

    async def hold(start: int, end: int) -> None:
        async with db.write() as tx:
            held = text("INSERT INTO holds VALUES (int8range(:start, :end))")
            await tx.execute(held, {"start": start, "end": end})

    await hold(1, 5)
    await hold(5, 9)
    with pytest.raises(RowRefused) as refused:
        await hold(4, 6)

    assert refused.value.constraint == "pad_taken"
