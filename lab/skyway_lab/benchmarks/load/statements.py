"""What PostgreSQL did during the burst, statement by statement: pg_stat_statements counts it."""

import os
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Final

import asyncpg
from skyway_lab.benchmarks.planner.table import Table

#: For the server: counts from its start on, the planning of statements too.
SERVER_OPTIONS: Final = (
    "-cshared_preload_libraries=pg_stat_statements",
    "-cpg_stat_statements.max=1000",
    "-cpg_stat_statements.track_planning=on",
)

#: Characters of each statement that are enough to know it.
_SHOWN: Final = 400

_COSTS: Final = """
    SELECT datname, sum(calls)::float AS calls, sum(rows)::float AS rows,
        sum(total_plan_time) AS planning_ms, sum(total_exec_time) AS running_ms, query
    FROM pg_stat_statements(true) AS counted JOIN pg_database ON pg_database.oid = counted.dbid
    WHERE datname <> 'postgres'
    GROUP BY datname, query
    ORDER BY sum(total_plan_time + total_exec_time) DESC
"""


@asynccontextmanager
async def statements_counted(
    folder: Path | None, *, dispatched: Callable[[], int]
) -> AsyncIterator[None]:
    """Leave the table of the block's statements in the folder, if there is one and a server."""
    url = os.environ.get("SKYWAY_DATABASE_URL")
    if folder is None or url is None:
        yield
        return
    connection = await asyncpg.connect(url)
    try:
        await connection.execute("CREATE EXTENSION IF NOT EXISTS pg_stat_statements")
        await connection.execute("SELECT pg_stat_statements_reset()")
        yield
        rows = await connection.fetch(_COSTS)
    finally:
        await connection.close()
    _leave(_table(rows, dispatched=max(1, dispatched())), folder)


def _leave(table: Table, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "postgresql.md").write_text(table.as_markdown() + "\n")


def _table(rows: list[asyncpg.Record], *, dispatched: int) -> Table:
    return Table(
        "load-statements",
        "What PostgreSQL did for each dispatch; times without what it takes to talk to it.",
        ("database", "calls", "rows", "planning, ms", "running, ms", "statement"),
        [
            (
                row["datname"].removeprefix("skyway_"),
                *(f"{row[name] / dispatched:.2f}" for name in ("calls", "rows")),
                *(f"{row[name] / dispatched:.3f}" for name in ("planning_ms", "running_ms")),
                " ".join(row["query"].split())[:_SHOWN],
            )
            for row in rows
        ],
    )
