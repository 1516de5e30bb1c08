"""A rule of the database has one name, whichever dialect refused the row."""

import pytest
from sqlalchemy import (
    CheckConstraint,
    Column,
    Index,
    Integer,
    MetaData,
    Table,
    Text,
    UniqueConstraint,
    text,
)
from sqlalchemy.exc import IntegrityError

from skyway.runtime.errors import RowRefused
from skyway.runtime.sql.database import Database

METADATA = MetaData()
MISSIONS = Table(
    "missions",
    METADATA,
    Column("id", Text, primary_key=True),
    Column("drone_id", Text),
    Column("state", Text),
    Column("delivery_id", Text),
    Column("attempt", Integer),
    Column("code", Text, unique=True),
    Column("mass_kg", Integer),
    UniqueConstraint("delivery_id", "attempt", name="mission_of_attempt"),
    CheckConstraint("mass_kg >= 0", name="mass_is_positive"),
)
Index(
    "one_mission_per_drone",
    MISSIONS.c.drone_id,
    unique=True,
    sqlite_where=MISSIONS.c.state == "ACTIVE",
    postgresql_where=MISSIONS.c.state == "ACTIVE",
)

TRIGGER = {
    "sqlite": [
        (
            "CREATE TRIGGER no_zero BEFORE INSERT ON missions WHEN NEW.attempt = 0"
            " BEGIN SELECT RAISE(ABORT, 'attempt_taken'); END"
        )
    ],
    "postgresql": [
        (
            "CREATE FUNCTION refuse() RETURNS trigger LANGUAGE plpgsql AS"
            " $$ BEGIN RAISE EXCEPTION 'attempt_taken'; END $$"
        ),
        (
            "CREATE TRIGGER no_zero BEFORE INSERT ON missions FOR EACH ROW"
            " WHEN (NEW.attempt = 0) EXECUTE FUNCTION refuse()"
        ),
    ],
}


@pytest.fixture
async def db(database: Database) -> Database:
    async with database.write() as tx:
        await tx.connection.run_sync(METADATA.create_all)
        for statement in TRIGGER[tx.dialect]:
            await tx.execute(text(statement))
        first = {"id": "m1", "drone_id": "d1", "state": "ACTIVE", "delivery_id": "y1"}
        await tx.execute(MISSIONS.insert(), {**first, "attempt": 1, "code": "c1"})
    return database


@pytest.mark.parametrize(
    ("row", "constraint"),
    [
        ({"id": "m1"}, "missions_pkey"),
        ({"id": "m2", "drone_id": "d1", "state": "ACTIVE"}, "one_mission_per_drone"),
        ({"id": "m2", "delivery_id": "y1", "attempt": 1}, "mission_of_attempt"),
        ({"id": "m2", "code": "c1"}, "missions_code_key"),
        ({"id": "m2", "attempt": 0}, "attempt_taken"),
    ],
)
async def test_a_refused_row_names_its_rule(
    db: Database, row: dict[str, object], constraint: str
) -> None:
    with pytest.raises(RowRefused) as refused:
        async with db.write() as tx:
            await tx.execute(MISSIONS.insert(), row)

    assert refused.value.constraint == constraint


@pytest.mark.parametrize("row", [{"id": None}, {"id": "m2", "mass_kg": -1}])
async def test_a_row_that_breaks_another_rule_is_a_fault_of_ours(
    db: Database, row: dict[str, object]
) -> None:
    with pytest.raises(IntegrityError):
        async with db.write() as tx:
            await tx.execute(MISSIONS.insert().values(row))


#: SQLite has no exclusion constraints: triggers stand in for them.
ON_POSTGRESQL = pytest.mark.parametrize(
    "database_url", [pytest.param("postgresql", marks=pytest.mark.integration)], indirect=True
)


@ON_POSTGRESQL
async def test_an_exclusion_constraint_names_itself(db: Database) -> None:
    async with db.write() as tx:
        await tx.execute(
            text(
                "CREATE TABLE holds (during int8range,"
                " CONSTRAINT pad_taken EXCLUDE USING gist (during WITH &&))"
            )
        )

    async def hold(start: int, end: int) -> None:
        async with db.write() as tx:
            held = text("INSERT INTO holds VALUES (int8range(:start, :end))")
            await tx.execute(held, {"start": start, "end": end})

    await hold(1, 5)
    await hold(5, 9)
    with pytest.raises(RowRefused) as refused:
        await hold(4, 6)

    assert refused.value.constraint == "pad_taken"
