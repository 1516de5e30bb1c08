"""PostgreSQL behind PgBouncer, which lends a server's connection for one transaction."""

import asyncio
import os
import shutil
import socket
import subprocess
import tempfile
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest
from sqlalchemy import (
    Column,
    Integer,
    MetaData,
    Table,
    Text,
    bindparam,
    func,
    insert,
    select,
    text,
    update,
)
from sqlalchemy.engine import make_url
from sqlalchemy.exc import DBAPIError

from skyway.runtime.sql.database import Database
from skyway.runtime.sql.migrations import migrate
from tests.conftest import unprivileged_user
from tests.end_to_end.eventually import eventually
from tests.library.runtime.sql.migration_package import Package

METADATA = MetaData()
CRATES = Table(
    "crates",
    METADATA,
    Column("name", Text, primary_key=True),
    Column("number", Integer, nullable=False),
)
#: Two connections to the server for many more clients, so that each transaction gets another one.
_CONFIGURATION = """
[databases]
* = host={host} user=skyway
[pgbouncer]
listen_addr = 127.0.0.1
listen_port = {port}
unix_socket_dir =
auth_type = any
pool_mode = transaction
default_pool_size = 2
max_client_conn = 100
"""
_BINARY = shutil.which("pgbouncer", path=f"{os.environ['PATH']}:/usr/sbin")

pytestmark = [
    pytest.mark.parametrize(
        "database_url", [pytest.param("postgresql", marks=pytest.mark.integration)], indirect=True
    ),
    pytest.mark.skipif(_BINARY is None, reason="PgBouncer is not installed"),
]


@pytest.fixture
def pooled_url(database_url: str) -> Iterator[str]:
    direct = make_url(database_url)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    user = unprivileged_user()
    with tempfile.TemporaryDirectory(prefix="skyway-pgbouncer-") as folder:
        configuration, log = Path(folder, "pgbouncer.ini"), Path(folder, "log")
        configuration.write_text(_CONFIGURATION.format(host=direct.query["host"], port=port))
        if user is not None:
            # The file too: a strict umask lets nobody but its owner read it.
            for path in (folder, configuration):
                os.chown(path, user.pw_uid, user.pw_gid)
        with log.open("wb") as output:
            process = subprocess.Popen(
                [str(_BINARY), str(configuration)],
                stdout=output,
                stderr=output,
                cwd=folder,
                user=None if user is None else user.pw_uid,
                group=None if user is None else user.pw_gid,
                extra_groups=None if user is None else [],
            )

        def listens() -> bool:
            assert process.poll() is None, log.read_text()
            with socket.socket() as client:
                return client.connect_ex(("127.0.0.1", port)) == 0

        try:
            eventually(listens, "PgBouncer listens", instead=log.read_text)
            yield f"postgresql://skyway@127.0.0.1:{port}/{direct.database}?pooling=transaction"
        finally:
            process.terminate()
            process.wait()


@pytest.fixture
async def db(pooled_url: str) -> AsyncIterator[Database]:
    async with Database(pooled_url) as opened:
        async with opened.write() as tx:
            await tx.connection.run_sync(METADATA.create_all)
        yield opened


@pytest.mark.long
async def test_many_clients_share_few_connections_of_the_server(
    db: Database, pooled_url: str
) -> None:
    async with Database(pooled_url) as other:

        async def work(database: Database, name: str) -> None:
            mine = CRATES.c.name == name
            added = update(CRATES).where(mine).values(number=CRATES.c.number + bindparam("more"))
            await database.write_alone(insert(CRATES), {"name": name, "number": 0})
            for n in range(10):
                await database.write_alone(insert(CRATES), {"name": f"{name}-{n}", "number": 0})
                await database.write_alone(added, {"more": 1})
                async with database.write() as tx:
                    await tx.execute(select(func.count()).select_from(CRATES))
                    await tx.execute(added, {"more": 1})
                async with database.read() as connection:
                    found = await connection.execute(select(CRATES.c.number).where(mine))
                    assert found.scalar_one() >= 1

        await asyncio.gather(
            *(work(database, f"{id(database)}-{n}") for database in (db, other) for n in range(12))
        )

    async with db.read() as connection:
        total = await connection.execute(select(func.sum(CRATES.c.number)))
        assert total.scalar_one() == 2 * 12 * 10 * 2


async def test_a_reader_cannot_write(db: Database) -> None:
    with pytest.raises(DBAPIError, match="read-only"):
        async with db.read() as connection:
            await connection.execute(insert(CRATES), {"name": "oak", "number": 1})


async def test_a_survey_sees_one_moment(db: Database) -> None:
    count = select(func.count()).select_from(CRATES)
    async with db.survey() as connection:
        before = (await connection.execute(count)).scalar_one()
        await db.write_alone(insert(CRATES), {"name": "oak", "number": 1})
        after = (await connection.execute(count)).scalar_one()

    assert (before, after) == (0, 0)


async def test_nothing_of_one_client_stays_in_the_connection(db: Database) -> None:
    async with db.read() as connection:
        found = await connection.execute(text("SELECT count(*) FROM pg_prepared_statements"))

    assert found.scalar_one() == 0


async def test_migrations_run_behind_a_pooler(
    db: Database, pooled_url: str, package: Package
) -> None:
    await migrate(pooled_url, package.name)

    async with db.read() as connection:
        names = await connection.execute(text("SELECT count(name) FROM stations"))
        assert names.scalar_one() == 0
