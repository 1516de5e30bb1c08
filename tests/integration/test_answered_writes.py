"""A write that was answered survives kill -9, with its outgoing messages."""

import asyncio
import subprocess
import sys

from sqlalchemy import text

from skyway.runtime.sql.database import Database

#: Writes without end, eight blocks in parallel, and prints the number of each answered write.
WRITER = """
import asyncio, itertools, sys
from sqlalchemy import Column, Integer, MetaData, Table
from skyway.json_model import JsonModel
from skyway.runtime.sql.database import Database
from skyway.runtime.outbox.outbox_store import outbox_table

class Note(JsonModel):
    number: int

METADATA = MetaData()
DELIVERIES = Table("deliveries", METADATA, Column("number", Integer, primary_key=True))
OUTBOX = outbox_table(METADATA)

async def accept(db, number):
    async with db.write() as tx:
        await tx.execute(DELIVERIES.insert(), {"number": number})
        tx.report("gateway", "/note", Note(number=number), stream=str(number))
    print(number, flush=True)

async def main():
    async with Database(sys.argv[1], outbox=OUTBOX) as db:
        async with db.write() as tx:
            await tx.connection.run_sync(METADATA.create_all)
        for first in itertools.count(step=8):
            await asyncio.gather(*(accept(db, first + more) for more in range(8)))

asyncio.run(main())
"""


async def test_every_answered_write_survives_kill_9(database_url: str) -> None:
    writer = await asyncio.create_subprocess_exec(
        sys.executable, "-c", WRITER, database_url, stdout=subprocess.PIPE
    )
    assert writer.stdout is not None
    async with asyncio.timeout(60):
        answered = {int(await writer.stdout.readline()) for _ in range(100)}
        writer.kill()
        answered |= {int(line) async for line in writer.stdout if line.endswith(b"\n")}
        await writer.wait()

    async with Database(database_url) as db, db.read() as connection:
        kept = set((await connection.execute(text("SELECT number FROM deliveries"))).scalars())
        streams = set((await connection.execute(text("SELECT stream FROM outbox"))).scalars())

    assert answered <= kept
    assert streams == {str(number) for number in kept}
