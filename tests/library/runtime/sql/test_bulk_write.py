"""A bulk write is written when its block ends: all of it or nothing, the same on both dialects."""

import asyncio
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
    bindparam,
    select,
    update,
)

from skyway.runtime.errors import RowRefused
from skyway.runtime.sql.bulk_write import BulkWrite, DerivedRows
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.single_statement import statement_of

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
CRATES = Table(
    "crates",
    METADATA,
    Column("shelf", Text, primary_key=True),
    Column("name", Text, primary_key=True),
    Column("weight", Integer, nullable=False),
    Column("moves", Integer, nullable=False),
)
MOVES = Table(
    "moves",
    METADATA,
    Column("name", Text, primary_key=True),
    Column("number", Integer, primary_key=True),
)

#: Finds station a, unless it is called otherwise by now.
OF_A = (
    update(STATIONS)
    .where(STATIONS.c.name == bindparam("known"))
    .values(name=bindparam("now"))
    .returning(STATIONS.c.name)
)
MOVED = DerivedRows(
    MOVES,
    CRATES,
    lambda crates: select(crates.c.name, crates.c.moves.label("number")).where(
        crates.c.shelf == bindparam("of"),
        crates.c.weight > bindparam("heavier_than", type_=Integer),
    ),
)


class GoneError(Exception):
    """The guard found nothing."""


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


def test_the_statement_is_the_same_for_any_number_of_rows() -> None:
    few, _ = statement_of(BulkWrite(added={PADS: [pad("a"), pad("b")]}))
    many, parameters = statement_of(BulkWrite(added={PADS: [pad("b"), pad("b", b"1"), pad("c")]}))

    assert many is few
    assert parameters["new_pads_sign"] == [None, b"1", None]


def test_a_single_row_is_given_without_arrays() -> None:
    _, parameters = statement_of(BulkWrite(added={PADS: [pad("b", b"1")]}))

    assert parameters["new_pads_sign"] == b"1"


async def test_a_row_that_is_refused_undoes_the_block(db: Database) -> None:
    async def add(*names: str) -> None:
        async with db.write() as tx:
            tx.add(STATIONS, [{"name": name} for name in names])

    await add("a")

    with pytest.raises(RowRefused) as refused:
        await add("b", "a")

    assert refused.value.constraint == "stations_pkey"
    async with db.read() as connection:
        assert (await connection.execute(select(STATIONS.c.name))).scalars().all() == ["a"]


async def test_a_block_that_adds_nothing_ends(db: Database) -> None:
    async with db.write() as tx:
        tx.add(STATIONS, [])


async def rows_of(db: Database, table: Table) -> list[tuple[Any, ...]]:
    async with db.read() as connection:
        rows = await connection.execute(select(table).order_by(*table.primary_key))
        return [tuple(row) for row in rows]


async def move(db: Database, *, known: str, heavier_than: int = 0) -> list[str]:
    """Write three weights, two of them moves, if station `known` exists; returns the callbacks."""
    notified: list[str] = []
    async with db.write() as tx:
        tx.add(STATIONS, [{"name": "c"}])
        tx.add_derived(
            MOVED,
            {"of": "top", "heavier_than": heavier_than},
            on_added=lambda: notified.append("moved"),
        )
        new = [
            {"name": name, "weight": weight, "moves": moves}
            for name, weight, moves in (("oak", 7, 1), ("elm", 0, 0), ("fir", 9, 2))
        ]
        tx.update_rows(CRATES, {"shelf": "top"}, new, key="name", increments=["moves"])
        tx.only_if(OF_A, {"known": known, "now": "b"}, otherwise=GoneError())
    return notified


@pytest.fixture
async def shelves(db: Database) -> Database:
    async with db.write() as tx:
        tx.add(STATIONS, [{"name": "a"}])
        rows = [(shelf, name) for shelf in ("low", "top") for name in ("elm", "fir", "oak")]
        tx.add(CRATES, [{"shelf": s, "name": n, "weight": 1, "moves": 3} for s, n in rows])
    return db


async def test_rows_are_updated_by_key_and_derived_rows_are_added(
    shelves: Database,
) -> None:
    assert await move(shelves, known="a") == ["moved"]

    assert await rows_of(shelves, STATIONS) == [("b",), ("c",)]
    assert await rows_of(shelves, CRATES) == [
        *(("low", name, 1, 3) for name in ("elm", "fir", "oak")),
        ("top", "elm", 0, 3),
        ("top", "fir", 9, 5),
        ("top", "oak", 7, 4),
    ]
    assert await rows_of(shelves, MOVES) == [("fir", 5), ("oak", 4)]


async def test_no_callback_is_called_without_derived_rows(shelves: Database) -> None:
    assert await move(shelves, known="a", heavier_than=9) == []

    assert await rows_of(shelves, MOVES) == []


async def test_nothing_is_written_when_the_guard_finds_no_row(shelves: Database) -> None:
    before = [await rows_of(shelves, table) for table in (STATIONS, CRATES, MOVES)]

    with pytest.raises(GoneError):
        await move(shelves, known="z")

    assert [await rows_of(shelves, table) for table in (STATIONS, CRATES, MOVES)] == before


async def test_only_one_of_several_blocks_with_the_same_guard_writes(shelves: Database) -> None:
    done = await asyncio.gather(
        *(move(shelves, known="a") for _ in range(4)), return_exceptions=True
    )

    assert sorted(map(str, done)) == ["", "", "", "['moved']"]
    assert await rows_of(shelves, MOVES) == [("fir", 5), ("oak", 4)]


async def test_a_block_depends_on_one_row(db: Database) -> None:
    async def depend_on(*known: str) -> None:
        async with db.write() as tx:
            for name in known:
                tx.only_if(OF_A, {"known": name, "now": "b"}, otherwise=GoneError())

    with pytest.raises(RuntimeError, match="one row"):
        await depend_on("a", "b")
