"""How Skyway opens PostgreSQL. Only a process that uses PostgreSQL loads its driver."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final, cast

import asyncpg
from sqlalchemy import event
from sqlalchemy.engine import URL, AdaptedConnection
from sqlalchemy.engine.interfaces import DBAPIConnection, IsolationLevel
from sqlalchemy.exc import DisconnectionError
from sqlalchemy.ext.asyncio import AsyncEngine, create_async_engine
from sqlalchemy.pool import AsyncAdaptedQueuePool

from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.sql.server_url import PostgresqlServer

#: Statements that a connection to PostgreSQL keeps prepared: more than a service has.
_STATEMENTS: Final = 500

#: How long a statement may take, seconds.
_STATEMENT_S: Final = 60.0

#: How long a block waits for a free connection, seconds.
_POOL_TIMEOUT_S: Final = 30.0


def postgresql_engine(url: URL, *, statement_s: float = _STATEMENT_S) -> AsyncEngine:
    """An engine whose transactions are READ COMMITTED.

    A statement that takes longer than `statement_s` seconds is cancelled.
    """
    server = PostgresqlServer.of(url)
    return _postgresql_engine(server, settings={}, statement_s=statement_s)


def postgresql_reader_engine(url: URL) -> AsyncEngine:
    """An engine that cannot write, and where each statement is its own transaction.

    READ COMMITTED lets each statement see the data of its own moment anyway, so BEGIN and ROLLBACK
    around the statements would be two round trips for nothing. Behind a pooler they are needed: the
    driver prepares a statement and runs it in two steps, which must meet the same server.
    """
    server = PostgresqlServer.of(url)
    if server.has_pooler:
        return _postgresql_engine(server, execution_options={"postgresql_readonly": True})
    return _postgresql_engine(
        server,
        isolation_level="AUTOCOMMIT",
        settings={"default_transaction_read_only": "on"},
    )


class CommitCheckingConnection(asyncpg.Connection):  # type: ignore[misc]  # asyncpg has no types
    """A connection to PostgreSQL that notices when a COMMIT did not commit.

    After a failed statement PostgreSQL answers COMMIT with ROLLBACK and reports no error.
    """

    async def execute(self, query: str, *args: Any, timeout: float | None = None) -> str:
        """Run statements and return the server's status. Any: values have every type."""
        status: str = await super().execute(query, *args, timeout=timeout)
        if status == "ROLLBACK" and query.startswith("COMMIT"):
            raise ServiceUnavailable("database", "not committed after an error in a statement")
        return status


class PooledConnection(CommitCheckingConnection):
    """A connection to a pooler, which may lend another server for each transaction."""

    async def set_type_codec(self, typename: str, **codec: Any) -> None:
        """Look the type up in one transaction, so with one server. Any: the driver's options."""
        async with self.transaction():
            await super().set_type_codec(typename, **codec)


def _postgresql_engine(
    server: PostgresqlServer,
    *,
    isolation_level: IsolationLevel = "READ COMMITTED",
    settings: Mapping[str, str] = MappingProxyType({}),
    statement_s: float = _STATEMENT_S,
    execution_options: Mapping[str, Any] = MappingProxyType({}),
) -> AsyncEngine:
    """Any: each execution option has a type of its own."""
    engine = create_async_engine(
        server.url.set(drivername="postgresql+asyncpg"),
        isolation_level=isolation_level,
        execution_options=dict(execution_options),
        hide_parameters=True,  # in the text of errors: some parameters are addresses
        skip_autocommit_rollback=True,
        poolclass=AsyncAdaptedQueuePool,
        pool_size=server.connections,
        max_overflow=0,
        pool_timeout=_POOL_TIMEOUT_S,
        # The connection used last has the most statements prepared.
        pool_use_lifo=True,
        connect_args={
            "timeout": 10,
            "command_timeout": statement_s,
            **(_KEEP_NOTHING if server.has_pooler else _keep_all(settings)),
        },
    )
    event.listen(engine.sync_engine, "checkout", _refuse_unusable)
    return engine


def _keep_all(settings: Mapping[str, str]) -> dict[str, Any]:
    """Options of a driver that has the server for itself. Any: each has a type of its own."""
    return {
        "connection_class": CommitCheckingConnection,
        "prepared_statement_cache_size": _STATEMENTS,
        "server_settings": {
            "jit": "off",
            # The data lies in memory, where random reads cost as much as sequential ones. The
            # default makes the server read whole tables to avoid disk seeks.
            "random_page_cost": "1.1",
            "default_transaction_isolation": "read committed",
            **settings,
        },
    }


#: Options of a driver behind a pooler: no settings of the session, no statements with a name.
#: Any: each has a type of its own.
_KEEP_NOTHING: Final[Mapping[str, Any]] = {
    "connection_class": PooledConnection,
    "prepared_statement_cache_size": 0,
    "statement_cache_size": 0,
}


def _refuse_unusable(connection: DBAPIConnection, _record: Any, _proxy: Any) -> None:
    """Make the pool replace a connection that is closed or still in a transaction.

    The driver notices immediately when the server closes a connection. Asking the server would be
    one more round trip for each block. Any: the pool's own objects, which are not used.
    """
    driver = cast("AdaptedConnection", connection).driver_connection
    if driver.is_closed() or driver.is_in_transaction():
        raise DisconnectionError("the connection cannot be used again")
