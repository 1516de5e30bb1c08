"""Faults of databases: read-only, locked, immutable, without room."""

import asyncio
import os
import sqlite3
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import asyncpg
from skyway_lab.benchmarks.chaos.faults.stage import Stage
from skyway_lab.benchmarks.chaos.schedule import PlannedFault

from skyway.errors import SkywayError

#: Wall seconds until the lock of a database, or an answer of the server, must be there.
_WITHIN_S = 10.0


@asynccontextmanager
async def read_only(_stage: Stage, _fault: PlannedFault) -> AsyncIterator[None]:
    """Let PostgreSQL refuse all writes."""
    await _set_read_only("on")
    try:
        yield
    finally:
        await _set_read_only("off")


async def _set_read_only(value: str) -> None:
    connection = await asyncpg.connect(os.environ["SKYWAY_DATABASE_URL"], timeout=_WITHIN_S)
    try:
        await connection.execute(f"ALTER SYSTEM SET default_transaction_read_only = {value}")
        await connection.execute("SELECT pg_reload_conf()")
    finally:
        await connection.close()


@asynccontextmanager
async def locked(stage: Stage, fault: PlannedFault) -> AsyncIterator[None]:
    """Hold the write lock of a SQLite database."""
    path = _database(stage, fault.target)
    connection = sqlite3.connect(
        path, timeout=_WITHIN_S, isolation_level=None, check_same_thread=False
    )
    try:
        await asyncio.to_thread(connection.execute, "BEGIN IMMEDIATE")
        yield
    finally:
        connection.close()


@asynccontextmanager
async def immutable(stage: Stage, fault: PlannedFault) -> AsyncIterator[None]:
    """Let no process open a SQLite database for writing, and end the process that has it open."""
    path = _database(stage, fault.target).resolve()
    files = [file for file in path.parent.glob(f"{path.name}*") if file.is_file()]
    _change_attribute("+i", files)
    try:
        stage.running.processes.kill(fault.target)
        yield
    finally:
        _change_attribute("-i", files)


@asynccontextmanager
async def full(stage: Stage, _fault: PlannedFault) -> AsyncIterator[None]:
    """Fill the disk of the SQLite databases."""
    if stage.disk is None:
        raise SkywayError("the databases have no disk of their own")
    stage.disk.fill()
    try:
        yield
    finally:
        stage.disk.empty()


def _database(stage: Stage, service: str) -> Path:
    return stage.running.system.folder.path / f"{service}.db"


def _change_attribute(change: str, files: list[Path]) -> None:
    subprocess.run(["chattr", change, *map(str, files)], check=True)
