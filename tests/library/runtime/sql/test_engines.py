"""Which databases are opened, and how."""

import pytest

from skyway.errors import InvalidInput
from skyway.runtime.sql.engines import read_url


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
