"""The URL of a database: which are read, and what Skyway's own parameters mean."""

import pytest

from skyway.errors import InvalidInput
from skyway.runtime.sql.server_url import PostgresqlServer, driver_url, read_url


@pytest.mark.parametrize(
    ("text", "driver", "name"),
    [
        ("sqlite:////data/gateway.db", "sqlite", "/data/gateway.db"),
        ("sqlite+aiosqlite:///gateway.db", "sqlite", "gateway.db"),
        ("postgresql://skyway@db:5432/gateway", "postgresql", "gateway"),
        ("postgresql+asyncpg://skyway@db/gateway", "postgresql", "gateway"),
    ],
)
def test_a_url_is_read_without_its_driver(text: str, driver: str, name: str) -> None:
    url = read_url(text)

    assert (url.drivername, url.database) == (driver, name)


@pytest.mark.parametrize("text", ["", "gateway.db", "mysql://skyway:hunter2@db/x", "sqlite://"])
def test_any_other_url_is_refused_without_showing_it(text: str) -> None:
    with pytest.raises(InvalidInput, match="database_url") as refused:
        read_url(text)

    assert "hunter2" not in str(refused.value)


def test_a_server_has_eight_connections_and_no_pooler_by_default() -> None:
    server = PostgresqlServer.of(read_url("postgresql://skyway@db/gateway"))

    assert (server.connections, server.has_pooler) == (8, False)


def test_skyways_own_parameters_do_not_reach_the_server() -> None:
    url = read_url("postgresql://skyway@db/gateway?connections=4&pooling=transaction&ssl=require")

    server = PostgresqlServer.of(url)

    assert (server.connections, server.has_pooler) == (4, True)
    assert dict(server.url.query) == {"ssl": "require"}


@pytest.mark.parametrize(
    "query",
    [
        "connections=0",
        "connections=65",
        "connections=many",
        "connections=1&connections=2",
        "pooling=session",
        "pooling=transaction&pooling=transaction",
    ],
)
def test_a_wrong_parameter_is_refused_by_name(query: str) -> None:
    with pytest.raises(InvalidInput, match=query.partition("=")[0]):
        read_url(f"postgresql://skyway:hunter2@db/gateway?{query}")


def test_of_several_servers_the_primary_is_used() -> None:
    text = "postgresql://skyway:a%2Cb@db-1:5433,db-2,[::1]:5434/gateway?ssl=require"

    assert driver_url(text) == (
        "postgresql://skyway:a%2Cb@/gateway?host=db-1%2Cdb-2%2C%3A%3A1&port=5433%2C5432%2C5434"
        "&ssl=require&target_session_attrs=primary"
    )


def test_another_choice_among_several_servers_is_kept() -> None:
    url = read_url("postgresql://skyway@db-1,db-2/gateway?target_session_attrs=any")

    assert url.query["target_session_attrs"] == "any"
