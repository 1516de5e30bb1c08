"""What a block adds is there once it ends: all of it, in the order given, in one statement."""

from typing import Any

import pytest
from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    ForeignKey,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
    select,
)

from skyway.runtime.database import Database
from skyway.runtime.errors import Taken
from skyway.runtime.insertion import insertion_of

METADATA = MetaData()
STATIONS = Table("stations", METADATA, Column("name", Text, primary_key=True))
PADS = Table(
    "pads",
    METADATA,
    Column("id", BigInteger().with_variant(Integer, "sqlite"), primary_key=True),
    Column("station", Text, ForeignKey("stations.name"), nullable=False),
    Column("is_free", Boolean),
    Column("sign", LargeBinary),
    sqlite_autoincrement=True,
)


@pytest.fixture
async def db(database: Database) -> Database:
    async with database.write() as tx:
        await tx.connection.run_sync(METADATA.create_all)
    return database


def pad(station: str, sign: bytes | None = None) -> dict[str, Any]:
    return {"station": station, "is_free": None if sign is None else True, "sign": sign}


async def test_rows_of_several_tables_are_added_when_the_block_ends(db: Database) -> None:
    async with db.write() as tx:
        tx.add(STATIONS, [{"name": "a"}, {"name": "b"}])
        tx.add(PADS, [pad("b", b"\0\xff"), pad("a")])
        tx.add(PADS, [pad("b")])
        seen_by_block = (await tx.connection.execute(select(PADS))).all()

    async with db.read() as connection:
        rows = (await connection.execute(select(PADS).order_by(PADS.c.id))).all()
    assert seen_by_block == []
    assert [tuple(row)[1:] for row in rows] == [
        ("b", True, b"\0\xff"),
        ("a", None, None),
        ("b", None, None),
    ]


def test_a_server_is_told_the_same_however_many_rows_there_are() -> None:
    few, _ = insertion_of({STATIONS: [{"name": "a"}], PADS: [pad("a")]})
    many, parameters = insertion_of({STATIONS: [{"name": "b"}], PADS: [pad("b"), pad("b", b"1")]})

    assert many is few
    assert parameters["stations_name"] == ["b"]
    assert parameters["pads_sign"] == [None, b"1"]


async def test_a_row_that_is_refused_undoes_the_block(db: Database) -> None:
    async def add(*names: str) -> None:
        async with db.write() as tx:
            tx.add(STATIONS, [{"name": name} for name in names])

    await add("a")

    with pytest.raises(Taken) as refused:
        await add("b", "a")

    assert refused.value.constraint == "stations_pkey"
    async with db.read() as connection:
        assert (await connection.execute(select(STATIONS.c.name))).scalars().all() == ["a"]


async def test_a_block_that_adds_nothing_ends(db: Database) -> None:
    async with db.write() as tx:
        tx.add(STATIONS, [])
