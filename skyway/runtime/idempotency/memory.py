"""What is remembered of answered calls, and for how long."""

import hmac
from dataclasses import dataclass, field
from typing import Final

from sqlalchemy import BigInteger, MetaData, bindparam, select

from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import IdempotencyKeyReused
from skyway.runtime.idempotency.answer import Answer
from skyway.runtime.idempotency.note import Note
from skyway.runtime.idempotency.table import idempotency_table
from skyway.runtime.sql.database import Database, Tx
from skyway.units import hours_to_s, moment_to_ms

#: How long a key is remembered, milliseconds of wall time (docs/reference/rest.md).
_KEPT_MS: Final = int(hours_to_s(24) * 1000)

#: The same table for the statements here: its name and columns are the same in every service.
_KEYS: Final = idempotency_table(MetaData())

# Statements of every request are made once: to make one takes as long as to run it.

_FORGOTTEN_MS: Final = bindparam("forgotten_ms", type_=BigInteger)
_THIS: Final = _KEYS.c.key_hash == bindparam("this")
_FIND: Final = select(_KEYS.c.body_hash, _KEYS.c.answer).where(
    _THIS, _KEYS.c.created_at_ms > _FORGOTTEN_MS
)
_FORGET: Final = _KEYS.delete().where(_THIS, _KEYS.c.created_at_ms <= _FORGOTTEN_MS)


@dataclass(frozen=True, slots=True)
class Memory:
    """What is known of one call: its key and its body."""

    note: Note
    body: bytes = field(repr=False)
    clock: FleetClock

    def keep(self, tx: Tx, answer: Answer) -> None:
        """Note how a call was answered, at the end of its act; known keys are refused there.

        Whoever makes the same call at the same time waits for our COMMIT.
        """
        row = {
            "key_hash": self.note.key_hash,
            "body_hash": self.note.body_hash(self.body),
            "answer": self.note.seal(answer),
            "created_at_ms": moment_to_ms(self.clock.wall_now()),
        }
        tx.add(_KEYS, [row])

    async def recall(self, db: Database) -> Answer | None:
        """How the call was answered before; None when it was not.

        Raises
        ------
        IdempotencyKeyReused
            Another call was answered under this key.
        """
        # On SQLite the call may be in the same COMMIT as ours, which nobody can read before.
        async with db.write() as tx:
            row = (await tx.execute(_FIND, self._this_key())).one_or_none()
        if row is None:
            return None
        if not hmac.compare_digest(row.body_hash, self.note.body_hash(self.body)):
            raise IdempotencyKeyReused
        return self.note.unseal(row.answer)

    async def forget(self, db: Database) -> None:
        """Forget the key if its day is over."""
        await db.write_alone(_FORGET, self._this_key())

    def _this_key(self) -> dict[str, object]:
        forgotten_ms = moment_to_ms(self.clock.wall_now()) - _KEPT_MS
        return {"this": self.note.key_hash, "forgotten_ms": forgotten_ms}


async def sweep(db: Database, clock: FleetClock) -> int:
    """Forget keys older than a day; how many."""
    oldest_ms = moment_to_ms(clock.wall_now()) - _KEPT_MS
    async with db.write() as tx:
        found = await tx.execute(_KEYS.delete().where(_KEYS.c.created_at_ms <= oldest_ms))
        return found.rowcount
