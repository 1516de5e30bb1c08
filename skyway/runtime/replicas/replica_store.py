"""The table of live replicas, and all its SQL. All times are of the database's clock.

A beat is one statement: it notes that a replica is live, deletes dead replicas, and returns the
live ones. Nothing belongs to a database session, so a pooler may give each statement another
connection.
"""

from collections.abc import Sequence
from typing import Any, Final

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    ColumnElement,
    CompoundSelect,
    MetaData,
    Table,
    Text,
    bindparam,
    cast,
    delete,
    func,
    select,
)
from sqlalchemy.dialects.postgresql import insert

from skyway.runtime.replicas.share import Member
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Database, Rest

#: A replica that was not seen for so long is dead, wall milliseconds: three beats are missing.
DEAD_AFTER_MS: Final = 2_100

#: The parameters of a beat.
_OWN_ID: Final = bindparam("own_id", type_=Text)
_IS_LISTENING: Final = bindparam("is_listening", type_=Boolean)


def replicas_table(metadata: MetaData) -> Table:
    """The table of a service's live replicas; on SQLite, with its single process, it is empty."""
    return Table(
        "replicas",
        metadata,
        Column("replica_id", Text, primary_key=True),
        Column("joined_wall_ms", BigInteger, nullable=False),
        Column("seen_wall_ms", BigInteger, nullable=False),
        Column("is_listening", Boolean, nullable=False),
    )


class ReplicaStore:
    """Stores the live replicas of one service; on SQLite, with one process, it stores nothing."""

    def __init__(
        self, db: Database, replicas: Table, *, open_rows: Sequence[ColumnElement[bool]] = ()
    ) -> None:
        self.has_one_process = db.dialect == "sqlite"
        self.rest = Rest(db, open_rows)
        self._db = db
        self._beat = _beat(replicas)
        self._living = select(replicas).where(_is_live(replicas, _database_now_ms()))
        self._leave = delete(replicas).where(replicas.c.replica_id == _OWN_ID)

    async def beat(self, own_id: str, *, is_listening: bool) -> tuple[Member, ...]:
        """Note that a replica is live, delete dead replicas, and return the live ones."""
        own = {"own_id": own_id, "is_listening": is_listening}
        return _members(await self._db.write_alone(self._beat, own))

    async def living(self) -> tuple[Member, ...]:
        """The live replicas."""
        async with self._db.read() as connection:
            return _members((await connection.execute(self._living)).all())

    async def leave(self, own_id: str) -> None:
        """Delete a replica that ends."""
        await self._db.write_alone(self._leave, {"own_id": own_id})


def _members(rows: Sequence[AnyRow]) -> tuple[Member, ...]:
    members = (Member(row.joined_wall_ms, row.replica_id, row.is_listening) for row in rows)
    return tuple(sorted(members))


# Any: the columns have several types.
def _beat(replicas: Table) -> CompoundSelect[*tuple[Any, ...]]:
    now_ms = _database_now_ms()
    new = insert(replicas).from_select(
        ["replica_id", "joined_wall_ms", "seen_wall_ms", "is_listening"],
        select(_OWN_ID, now_ms, now_ms, _IS_LISTENING),
    )
    # After a failover the clock of the new database server may be behind.
    joined_ms = func.least(replicas.c.joined_wall_ms, now_ms)
    own = (
        new.on_conflict_do_update(
            index_elements=[replicas.c.replica_id],
            set_={
                "joined_wall_ms": joined_ms,
                "seen_wall_ms": now_ms,
                "is_listening": _IS_LISTENING,
            },
        )
        .returning(*replicas.c)
        .cte("own")
    )
    others = replicas.c.replica_id != _OWN_ID
    # Two replicas that wait for each other's rows would be a deadlock.
    dead = (
        select(replicas.c.replica_id)
        .where(others, ~_is_live(replicas, now_ms))
        .with_for_update(skip_locked=True)
        .cte("dead")
    )
    buried = delete(replicas).where(replicas.c.replica_id.in_(select(dead.c.replica_id)))
    living = select(replicas).where(others, _is_live(replicas, now_ms))
    return select(own).union_all(living).add_cte(buried.cte("buried"))


def _is_live(replicas: Table, now_ms: ColumnElement[int]) -> ColumnElement[bool]:
    """Whether a replica was seen lately; a row from the future has damage or a wrong clock."""
    return replicas.c.seen_wall_ms.between(now_ms - DEAD_AFTER_MS, now_ms + DEAD_AFTER_MS)


def _database_now_ms() -> ColumnElement[int]:
    return cast(func.extract("epoch", func.statement_timestamp()) * 1000, BigInteger)
