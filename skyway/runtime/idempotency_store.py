"""The same Idempotency-Key gives the same effect and the same answer for a day.

The answer is stored under its key at the end of the act, in the transaction of the act. So both are
stored or neither is. If the key is stored already, the act is undone and the stored answer is given
again. After an act that fails, the stored answer is looked up too: the act may fail because it was
done before. Stored answers cannot be read without the key: only a hash that is derived from the key
is stored. The answer may hold secrets that are shown once, so it is sealed with another value
derived from the key.
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
from skyway.runtime.errors import IdempotencyKeyReused, RowRefused
from skyway.runtime.sql.database import Database, Tx
from skyway.units import hours_to_s, moment_to_ms

_LONGEST_KEY: Final = 255

#: How long an answer is stored, milliseconds of wall time.
KEPT_MS: Final = int(hours_to_s(24) * 1000)

_EXPIRED_MS: Final = bindparam("expired_ms", type_=BigInteger)


@dataclass(frozen=True, slots=True)
class Answer:
    """An HTTP answer as it was first given."""

    status: int
    body: bytes
    headers: Mapping[str, str] = field(default_factory=dict)
    #: Whether this is a stored answer, given again without any effect.
    is_replayed: bool = field(default=False, compare=False)


@dataclass(frozen=True, slots=True)
class KeySecrets:
    """The values that are derived from one key within its scope."""

    key_hash: str
    body_key: bytes = field(repr=False)
    answer_key: bytes = field(repr=False)

    @classmethod
    def derive(cls, caller: str, route: str, key: str) -> Self:
        """The secrets of this caller's key on this route.

        Raises
        ------
        InvalidInput
            The key is empty or longer than 255 characters.
        """
        if not 0 < len(key) <= _LONGEST_KEY:
            raise InvalidInput("Idempotency-Key", f"1 to {_LONGEST_KEY} characters, got {len(key)}")
        # JSON distinguishes ("ab", "c") from ("a", "bc").
        scope = json.dumps([caller, route]).encode()
        derived = HKDF(SHA256(), length=96, salt=None, info=scope).derive(key.encode())
        return cls(derived[:32].hex(), derived[32:64], derived[64:])

    def body_hash(self, body: bytes) -> bytes:
        """A hash that identifies the body; it cannot be computed without the key."""
        return hmac.digest(self.body_key, body, hashlib.sha256)

    def seal(self, answer: Answer) -> bytes:
        """The answer, encrypted so that only the key opens it."""
        text = json.dumps([answer.status, b64encode(answer.body).decode(), dict(answer.headers)])
        return self._fernet().encrypt(text.encode())

    def unseal(self, sealed: bytes) -> Answer:
        """The sealed answer, marked as given again."""
        status, body, headers = json.loads(self._fernet().decrypt(sealed))
        return Answer(status, b64decode(body), headers, is_replayed=True)

    def _fernet(self) -> Fernet:
        return Fernet(urlsafe_b64encode(self.answer_key))


def idempotency_table(metadata: MetaData) -> Table:
    """The table of stored answers."""
    return Table(
        "idempotency",
        metadata,
        Column("key_hash", Text, primary_key=True),
        Column("body_hash", LargeBinary, nullable=False),
        Column("answer", LargeBinary),
        Column("created_at_ms", BigInteger, nullable=False),
        # The path of the thing that the call created; null if the answer names none.
        Column("location", Text),
        Index("idempotency_age", "created_at_ms"),
    )


#: The same table for the statements here: its name and columns are the same in every service.
_KEYS: Final = idempotency_table(MetaData())

# Each statement is made once, because making it takes as long as running it.

_THIS: Final = _KEYS.c.key_hash == bindparam("this")
_FIND: Final = select(_KEYS.c.body_hash, _KEYS.c.answer).where(
    _THIS, _KEYS.c.created_at_ms > _EXPIRED_MS
)
#: The rule of the database that refuses a key a second time.
_ONE_ANSWER: Final = "idempotency_pkey"

_FIRST_SERVER_ERROR: Final = 500


@dataclass(frozen=True, slots=True)
class KeyedCall:
    """A caller's call of a route, and the Idempotency-Key under which it may be repeated."""

    caller: str
    route: str
    key: str | None
    body: bytes = field(repr=False)


#: The act of a request, in the given transaction.
Act = Callable[[Tx], Awaitable[Answer]]

#: The answers that one transaction deletes at most: other writers do not wait for long.
_DELETED_TOGETHER: Final = 1000

_DELETE_SOME_EXPIRED: Final = _KEYS.delete().where(
    _KEYS.c.key_hash.in_(
        select(_KEYS.c.key_hash)
        .where(_KEYS.c.created_at_ms <= _EXPIRED_MS)
        .limit(_DELETED_TOGETHER)
    )
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
        """The answer that the call got before; None if no answer is stored.

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
    """Delete answers that are older than a day, some in each transaction; how many there were."""
    old = {"expired_ms": moment_to_ms(clock.wall_now()) - KEPT_MS}
    count = 0
    while True:
        async with db.write() as tx:
            deleted = (await tx.execute(_DELETE_SOME_EXPIRED, old)).rowcount
        count += deleted
        if deleted < _DELETED_TOGETHER:
            return count


async def once(db: Database, call: KeyedCall, *, act: Act, clock: FleetClock) -> Answer:
    """The answer of `act`, or the stored answer to this caller's same call on this route.

    Without a key the act happens, and nothing is stored. A 5xx answer undoes the act and is not
    stored. An error that the act raises is not stored either.

    Raises
    ------
    IdempotencyKeyReused
        The key came before with another body.
    InvalidInput
        The key is empty or longer than 255 characters.
    """
    stored = _stored_answer(call, clock)
    try:
        return await _act(db, act, stored)
    except (SkywayError, _Failed) as error:
        previous = None if stored is None else await stored.load(db)
        if previous is not None:
            return previous
        if stored is not None and isinstance(error, RowRefused) and error.constraint == _ONE_ANSWER:
            await stored.delete_if_expired(db)
            return await once(db, call, act=act, clock=clock)
        if isinstance(error, _Failed):
            return error.answer
        raise


async def answered_before(db: Database, call: KeyedCall, *, clock: FleetClock) -> Answer | None:
    """The stored answer to this caller's same call; None without one, or without a key.

    A route that asks other services looks here first, so that a repeated call does not ask them
    again.

    Raises
    ------
    IdempotencyKeyReused, InvalidInput
        As for `once`.
    """
    stored = _stored_answer(call, clock)
    return None if stored is None else await stored.load(db)


def _stored_answer(call: KeyedCall, clock: FleetClock) -> StoredAnswer | None:
    if call.key is None:
        return None
    secrets = KeySecrets.derive(call.caller, call.route, call.key)
    return StoredAnswer(secrets, call.body, clock)


async def _act(db: Database, act: Act, stored: StoredAnswer | None) -> Answer:
    async with db.write() as tx:
        answer = _unless_failed(await act(tx))
        if stored is not None:
            stored.save(tx, answer)
    return answer


class _Failed(Exception):
    """Leaves the write block after a 5xx answer, which rolls the block back."""

    def __init__(self, answer: Answer) -> None:
        super().__init__(answer.status)
        self.answer = answer


def _unless_failed(answer: Answer) -> Answer:
    if answer.status >= _FIRST_SERVER_ERROR:
        raise _Failed(answer)
    return answer
