"""How SQLite is opened, and where its statements run."""

import asyncio
from pathlib import Path

from skyway.runtime.sql.sqlite_engines import connect


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
