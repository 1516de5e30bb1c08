"""Which statements are written for the driver, and for how long they are known."""

import gc
import weakref

from sqlalchemy import Column, Executable, Integer, MetaData, Table, Text, bindparam, select, text
from sqlalchemy.dialects.postgresql.asyncpg import dialect

from skyway.runtime.sql.written import Written, WrittenStatements

PADS = Table("pads", MetaData(), Column("id", Integer, primary_key=True), Column("name", Text))
POSTGRESQL = dialect()  # type: ignore[no-untyped-call]  # SQLAlchemy has no types there


def known(statements: WrittenStatements, statement: Executable, *names: str) -> Written | None:
    return statements.get(statement, names, many=False, dialect=POSTGRESQL)


def test_a_statement_is_written_once_when_it_is_run_again() -> None:
    statements, statement = WrittenStatements(), select(PADS.c.name).where(PADS.c.id == 7)

    first, second, third, fourth = (known(statements, statement) for _ in range(4))

    assert (first, second) == (None, None)
    assert third is not None
    assert third is fourth
    assert third.values({}) == [7]


def test_other_parameters_are_another_text() -> None:
    statements, adding = WrittenStatements(), PADS.insert()
    for _ in range(2):
        known(statements, adding, "id", "name")

    both, name = known(statements, adding, "name", "id"), known(statements, adding, "id")

    assert both is not None
    assert name is not None
    assert both.text != name.text
    assert both.values({"name": "a", "id": 1}) == [1, "a"]


def test_a_statement_that_nobody_holds_is_forgotten() -> None:
    statements, statement = WrittenStatements(), select(PADS).where(PADS.c.id == bindparam("of"))
    written = [known(statements, statement, "of") for _ in range(3)].pop()
    assert written is not None
    gone = weakref.ref(written)

    del statement, written
    gc.collect()

    assert gone() is None


def test_what_sqlalchemy_must_see_to_is_not_written() -> None:
    statements = WrittenStatements()
    key_is_asked_for = PADS.insert()
    finds_a_text = select(PADS.c.id, text("1"))
    has_a_list = select(PADS).where(PADS.c.id.in_(bindparam("ids", expanding=True)))

    for _ in range(4):
        assert known(statements, text("SELECT 1")) is None
        assert known(statements, key_is_asked_for, "name") is None
        assert known(statements, finds_a_text) is None
        assert known(statements, has_a_list, "ids") is None
