"""The table of answers that were given under an Idempotency-Key, and its SQL."""

import hmac
from dataclasses import dataclass, field
from typing import Final

from sqlalchemy import (
    BigInteger,
    Column,
    Index,
    LargeBinary,
    MetaData,
    Table,
    Text,
    bindparam,
    select,
)

from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import IdempotencyKeyReused
from skyway.runtime.idempotency.key_secrets import Answer, KeySecrets
from skyway.runtime.sql.database import Database, Tx
from skyway.units import hours_to_s, moment_to_ms

#: How long an answer is stored, milliseconds of wall time.
KEPT_MS: Final = int(hours_to_s(24) * 1000)


def idempotency_table(metadata: MetaData) -> Table:
    """The table of stored answers."""
    return Table(
        "idempotency",
        metadata,
        Column("key_hash", Text, primary_key=True),
        Column("body_hash", LargeBinary, nullable=False),
        Column("answer", LargeBinary),
        Column("created_at_ms", BigInteger, nullable=False),
        # The path of what the call made; null if the answer names none.
        Column("location", Text),
        Index("idempotency_age", "created_at_ms"),
    )


#: The same table for the statements here: its name and columns are the same in every service.
_KEYS: Final = idempotency_table(MetaData())

# Statements of every request are made once: making one takes as long as running it.

_EXPIRED_MS: Final = bindparam("expired_ms", type_=BigInteger)
_THIS: Final = _KEYS.c.key_hash == bindparam("this")
_FIND: Final = select(_KEYS.c.body_hash, _KEYS.c.answer).where(
    _THIS, _KEYS.c.created_at_ms > _EXPIRED_MS
)
_DELETE_EXPIRED: Final = _KEYS.delete().where(_THIS, _KEYS.c.created_at_ms <= _EXPIRED_MS)


@dataclass(frozen=True, slots=True)
class StoredAnswer:
    """The stored answer of one call, found by its key and body."""

    secrets: KeySecrets
    body: bytes = field(repr=False)
    clock: FleetClock

    def save(self, tx: Tx, answer: Answer) -> None:
        """Store the answer at the end of the block; a key that is stored already is refused there.

        The same call in another transaction waits for our COMMIT.
        """
        row = {
            "key_hash": self.secrets.key_hash,
            "body_hash": self.secrets.body_hash(self.body),
            "answer": self.secrets.seal(answer),
            "created_at_ms": moment_to_ms(self.clock.wall_now()),
            "location": answer.headers.get("Location"),
        }
        tx.add(_KEYS, [row])

    async def load(self, db: Database) -> Answer | None:
        """How the call was answered before; None when no answer is stored.

        Raises
        ------
        IdempotencyKeyReused
            Another call was answered under this key.
        """
        # On SQLite the other call may be in the same COMMIT as ours: a reader could not see it.
        async with db.write() as tx:
            row = (await tx.execute(_FIND, self._this_key())).one_or_none()
        if row is None:
            return None
        if not hmac.compare_digest(row.body_hash, self.secrets.body_hash(self.body)):
            raise IdempotencyKeyReused
        return self.secrets.unseal(row.answer)

    async def delete_if_expired(self, db: Database) -> None:
        """Delete the stored answer if its day is over."""
        await db.write_alone(_DELETE_EXPIRED, self._this_key())

    def _this_key(self) -> dict[str, object]:
        expired_ms = moment_to_ms(self.clock.wall_now()) - KEPT_MS
        return {"this": self.secrets.key_hash, "expired_ms": expired_ms}


async def sweep(db: Database, clock: FleetClock) -> int:
    """Delete answers that are older than a day; how many there were."""
    oldest_ms = moment_to_ms(clock.wall_now()) - KEPT_MS
    async with db.write() as tx:
        deleted = await tx.execute(_KEYS.delete().where(_KEYS.c.created_at_ms <= oldest_ms))
        return deleted.rowcount
