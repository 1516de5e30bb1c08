"""The same Idempotency-Key, the same effect and the same answer, for a day.

The key is noted with the answer, once the act is done and in its transaction, so there is never one
without the other. An act whose key turns out to be known is undone. One that fails is looked up
too: what makes it fail may be that it was done before. At rest nothing can be read: of the key a
derived value is stored, and the answer, which may hold secrets that are shown once, is sealed
under another value derived from the same key.
"""

import hashlib
import hmac
import json
from base64 import b64decode, b64encode, urlsafe_b64encode
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, Self

from cryptography.fernet import Fernet
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDF
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

from skyway.errors import InvalidInput, SkywayError
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database, Tx
from skyway.runtime.errors import IdempotencyKeyReused, Taken
from skyway.units import hours_to_s, moment_to_ms

#: How long a key is remembered, milliseconds of wall time (contracts.md).
_KEPT_MS: Final = int(hours_to_s(24) * 1000)
_LONGEST_KEY: Final = 255
_FIRST_SERVER_ERROR: Final = 500


@dataclass(frozen=True, slots=True)
class Answer:
    """An HTTP answer as it was first given."""

    status: int
    body: bytes
    headers: Mapping[str, str] = field(default_factory=dict)
    #: Whether it was remembered, and nothing happened this time.
    is_replayed: bool = field(default=False, compare=False)


#: What a request does, inside the transaction it is given.
Act = Callable[[Tx], Awaitable[Answer]]


def idempotency_table(metadata: MetaData) -> Table:
    """The table of remembered answers."""
    return Table(
        "idempotency",
        metadata,
        Column("key_hash", Text, primary_key=True),
        Column("body_hash", LargeBinary, nullable=False),
        Column("answer", LargeBinary),
        Column("created_at_ms", BigInteger, nullable=False),
        Index("idempotency_age", "created_at_ms"),
    )


#: The same table for the statements here: its name and columns are the same in every service.
_KEYS: Final = idempotency_table(MetaData())

# Statements of every request are made once: to make one takes as long as to run it.

_FORGOTTEN_MS: Final = bindparam("forgotten_ms", type_=BigInteger)
_THIS: Final = _KEYS.c.key_hash == bindparam("this")
_FIND: Final = select(_KEYS.c.body_hash, _KEYS.c.answer).where(
    _THIS, _KEYS.c.created_at_ms > _FORGOTTEN_MS
)
_FORGET: Final = _KEYS.delete().where(_THIS, _KEYS.c.created_at_ms <= _FORGOTTEN_MS)


#: The rule that refuses a key that is known.
_ONE_ANSWER: Final = "idempotency_pkey"


async def once(
    db: Database,
    *,
    caller: str,
    route: str,
    key: str | None,
    body: bytes,
    act: Act,
    clock: FleetClock,
) -> Answer:
    """The answer of `act`, or the one that this caller's same call on this route got before.

    Without a key the act simply happens. An answer 5xx undoes the act and is not remembered, nor
    is an error that the act raises.

    Raises
    ------
    IdempotencyKeyReused
        The key came before with another body.
    InvalidInput
        The key is empty or longer than 255 characters.
    """
    memory = None if key is None else _Memory(_Note.derive(caller, route, key), body, clock)
    try:
        return await _act(db, act, memory)
    except (SkywayError, _Failed) as error:
        known = None if memory is None else await memory.recall(db)
        if known is not None:
            return known
        if memory is not None and isinstance(error, Taken) and error.constraint == _ONE_ANSWER:
            await memory.forget(db)
            return await once(
                db, caller=caller, route=route, key=key, body=body, act=act, clock=clock
            )
        if isinstance(error, _Failed):
            return error.answer
        raise


async def _act(db: Database, act: Act, memory: "_Memory | None") -> Answer:
    async with db.write() as tx:
        answer = _unless_failed(await act(tx))
        if memory is not None:
            memory.keep(tx, answer)
    return answer


async def sweep(db: Database, clock: FleetClock) -> int:
    """Forget keys older than a day; how many."""
    oldest_ms = moment_to_ms(clock.wall_now()) - _KEPT_MS
    async with db.write() as tx:
        found = await tx.execute(_KEYS.delete().where(_KEYS.c.created_at_ms <= oldest_ms))
        return found.rowcount


class _Failed(Exception):
    """Leaves the write block, and so undoes it, with an answer of the server's own failure."""

    def __init__(self, answer: Answer) -> None:
        super().__init__(answer.status)
        self.answer = answer


def _unless_failed(answer: Answer) -> Answer:
    if answer.status >= _FIRST_SERVER_ERROR:
        raise _Failed(answer)
    return answer


@dataclass(frozen=True, slots=True)
class _Note:
    """What is derived from a key within its scope: none of it leads back to the key."""

    key_hash: str
    body_key: bytes = field(repr=False)
    answer_key: bytes = field(repr=False)

    @classmethod
    def derive(cls, caller: str, route: str, key: str) -> Self:
        if not 0 < len(key) <= _LONGEST_KEY:
            raise InvalidInput("Idempotency-Key", f"1 to {_LONGEST_KEY} characters, got {len(key)}")
        # JSON keeps ("ab", "c") and ("a", "bc") apart.
        scope = json.dumps([caller, route]).encode()
        derived = HKDF(SHA256(), length=96, salt=None, info=scope).derive(key.encode())
        return cls(derived[:32].hex(), derived[32:64], derived[64:])

    def body_hash(self, body: bytes) -> bytes:
        return hmac.digest(self.body_key, body, hashlib.sha256)

    def seal(self, answer: Answer) -> bytes:
        text = json.dumps([answer.status, b64encode(answer.body).decode(), dict(answer.headers)])
        return self._fernet().encrypt(text.encode())

    def unseal(self, sealed: bytes) -> Answer:
        status, body, headers = json.loads(self._fernet().decrypt(sealed))
        return Answer(status, b64decode(body), headers, is_replayed=True)

    def _fernet(self) -> Fernet:
        return Fernet(urlsafe_b64encode(self.answer_key))


@dataclass(frozen=True, slots=True)
class _Memory:
    """What is known of one call: its key and its body."""

    note: _Note
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
