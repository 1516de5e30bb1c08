"""The URL of a database, and the parts of a PostgreSQL URL that only Skyway reads.

``postgresql://user@host:5432/name`` may name several servers, separated by commas: the process
connects to the one that is primary. Two parameters are for Skyway and not for the server:
``connections`` and ``pooling=transaction``.
"""

from dataclasses import dataclass
from typing import Final, Literal, Self
from urllib.parse import urlsplit

from sqlalchemy import make_url
from sqlalchemy.engine import URL
from sqlalchemy.exc import ArgumentError

from skyway.errors import InvalidInput

Dialect = Literal["sqlite", "postgresql"]

#: Connections that one process keeps to write, and as many to read, without ``connections``.
_CONNECTIONS: Final = 8
_MOST_CONNECTIONS: Final = 64

_OUR_PARAMETERS: Final = ("connections", "pooling")
_DEFAULT_PORT: Final = "5432"


def read_url(text: str) -> URL:
    """The URL of a database, without a driver.

    Raises
    ------
    InvalidInput
        It is neither ``sqlite:///path`` nor ``postgresql://...``, or one of Skyway's parameters is
        wrong; the message holds no password.
    """
    try:
        url = make_url(_with_hosts_in_query(text))
    except (ArgumentError, ValueError) as error:
        raise InvalidInput("database_url", "not a URL") from error
    dialect = url.get_backend_name()
    if dialect not in ("sqlite", "postgresql") or (dialect == "sqlite" and not url.database):
        raise InvalidInput(
            "database_url", f"{dialect}: only sqlite:///path and postgresql://... are supported"
        )
    if dialect == "postgresql":
        PostgresqlServer.of(url)
    return url.set(drivername=dialect)


def driver_url(text: str) -> str:
    """The URL of a PostgreSQL database as its driver understands it, with the password.

    Raises
    ------
    InvalidInput
        As for `read_url`.
    """
    return PostgresqlServer.of(read_url(text)).url.render_as_string(hide_password=False)


@dataclass(frozen=True, slots=True)
class PostgresqlServer:
    """How to connect to a PostgreSQL server.

    Attributes
    ----------
    url
        Without the parameters that only Skyway reads.
    connections
        Connections of one process to write, and as many to read, 1 to 64.
    has_pooler
        A pooler such as PgBouncer stands before the server and lends a connection of the server for
        one transaction. So nothing may be kept in a connection between two transactions.
    """

    url: URL
    connections: int
    has_pooler: bool

    @classmethod
    def of(cls, url: URL) -> Self:
        """Read Skyway's parameters of a URL.

        Raises
        ------
        InvalidInput
            A parameter has a value that it cannot have, or stands twice.
        """
        connections = url.query.get("connections", str(_CONNECTIONS))
        if not isinstance(connections, str) or not connections.isdecimal():
            raise InvalidInput("database_url", f"connections: {connections!r} is not a number")
        if not 1 <= int(connections) <= _MOST_CONNECTIONS:
            limits = f"1 to {_MOST_CONNECTIONS}"
            raise InvalidInput("database_url", f"connections: {connections} is not {limits}")
        pooling = url.query.get("pooling")
        if pooling not in (None, "transaction"):
            raise InvalidInput("database_url", f"pooling: {pooling!r} is not 'transaction'")
        return cls(
            url=url.difference_update_query(_OUR_PARAMETERS),
            connections=int(connections),
            has_pooler=pooling is not None,
        )


def _with_hosts_in_query(text: str) -> str:
    """Move several servers into the query, where SQLAlchemy and the driver read them."""
    parts = urlsplit(text)
    user, at, hosts = parts.netloc.rpartition("@")
    if "," not in hosts:
        return text
    servers = [_host_and_port(each) for each in hosts.split(",")]
    query = [
        *filter(None, [parts.query]),
        "host=" + ",".join(host for host, _ in servers),
        "port=" + ",".join(port for _, port in servers),
    ]
    if "target_session_attrs=" not in parts.query:
        query.append("target_session_attrs=primary")
    return f"{parts.scheme}://{user}{at}{parts.path}?{'&'.join(query)}"


def _host_and_port(server: str) -> tuple[str, str]:
    """The host and port in ``host:port``, ``host`` or ``[IPv6]:port``."""
    if server.startswith("["):
        host, _, port = server[1:].partition("]")
        return host, port.removeprefix(":") or _DEFAULT_PORT
    host, _, port = server.partition(":")
    return host, port or _DEFAULT_PORT
