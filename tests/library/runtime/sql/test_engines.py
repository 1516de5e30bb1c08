"""How SQLite is opened, and where its statements run."""

import asyncio
from pathlib import Path

import pytest

from skyway.errors import InvalidInput
from skyway.runtime.sql.engines import connect, read_url


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


async def test_a_statement_does_not_let_others_run_before_it_is_over(tmp_path: Path) -> None:
    others: list[str] = []
    connection = await connect(str(tmp_path / "service.db"))
    asyncio.get_running_loop().call_soon(others.append, "ran")

    rows = await connection.execute_fetchall("SELECT 1")

    assert [tuple(row) for row in rows] == [(1,)]
    assert others == []
    await connection.close()


async def test_a_waiter_for_the_writing_lock_lets_its_holder_go_on(tmp_path: Path) -> None:
    path = str(tmp_path / "service.db")
    holder = await connect(path, isolation_level=None, timeout=30)
    waiter = await connect(path, isolation_level=None, timeout=30)
    await holder.execute_fetchall("BEGIN IMMEDIATE")

    waiting = asyncio.create_task(waiter.execute_fetchall("BEGIN IMMEDIATE"))
    await asyncio.sleep(0)
    await holder.execute_fetchall("COMMIT")
    await asyncio.wait_for(waiting, timeout=60)

    await waiter.execute_fetchall("COMMIT")
    await holder.close()
    await waiter.close()
