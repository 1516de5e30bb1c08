"""The database of each service of a local system: a SQLite file, or PostgreSQL."""

import os
from collections.abc import Sequence
from urllib.parse import SplitResult, urlsplit

from skyway.cli.data_folder import CLOUD_SERVICES, DataFolder
from skyway.cli.system.retry import NotNow
from skyway.errors import SkywayError

#: Classes of SQLSTATE that a person must settle: a refused role or password, no such database, and
#: a role that may not create databases. https://www.postgresql.org/docs/current/errcodes-appendix.html
_WRONG_SETTINGS = ("28", "3D", "42")


async def database_urls(folder: DataFolder, cells: Sequence[str] = ()) -> dict[str, str]:
    """As `named_databases`; missing PostgreSQL databases are created.

    Raises
    ------
    NotNow
        The server does not answer now.
    SkywayError
        The server refuses the role, or the URL is wrong.
    """
    urls = named_databases(folder, cells)
    if (server := os.environ.get("SKYWAY_DATABASE_URL")) is not None:
        names = [urlsplit(url).path.lstrip("/") for url in urls.values()]
        await _create_missing(urlsplit(server), names)
    return urls


def named_databases(folder: DataFolder, cells: Sequence[str] = ()) -> dict[str, str]:
    """The database URL of each service and cell.

    `SKYWAY_DATABASE_URL` names a PostgreSQL server, and the database to make others from.

    Raises
    ------
    SkywayError
        The URL is not one of PostgreSQL.
    """
    server = os.environ.get("SKYWAY_DATABASE_URL")
    every = (*CLOUD_SERVICES, *cells)
    if server is None:
        return {service: folder.database_url(service) for service in every}
    parts = urlsplit(server)
    if parts.scheme != "postgresql":
        raise SkywayError(
            f"SKYWAY_DATABASE_URL begins with {parts.scheme}://; it must begin with postgresql://"
        )
    names = {service: f"skyway_{service.replace('-', '_')}" for service in every}
    return {service: _with_database(parts, name) for service, name in names.items()}


def _with_database(server: SplitResult, database: str) -> str:
    # Not geturl(): it drops the empty host of a URL that names a socket folder in its query.
    query = f"?{server.query}" if server.query else ""
    return f"{server.scheme}://{server.netloc}/{database}{query}"


async def _create_missing(server: SplitResult, databases: list[str]) -> None:
    import asyncpg

    from skyway.runtime.sql.server_url import driver_url

    try:
        url = _with_database(server, server.path.lstrip("/") or "postgres")
        connection = await asyncpg.connect(driver_url(url), timeout=10)
        try:
            rows = await connection.fetch("SELECT datname FROM pg_database")
            present = {row["datname"] for row in rows}
            for database in databases:
                if database not in present:
                    await connection.execute(f'CREATE DATABASE "{database}"')
        finally:
            await connection.close()
    except (OSError, asyncpg.PostgresError, asyncpg.InterfaceError) as error:
        state = getattr(error, "sqlstate", None) or ""
        kind = SkywayError if state.startswith(_WRONG_SETTINGS) else NotNow
        words = str(error) or type(error).__name__
        raise kind(f"SKYWAY_DATABASE_URL: the server does not do what is asked: {words}") from error
