"""The same Idempotency-Key, the same effect and the same answer, for a day.

The key is noted in the transaction of the act, so there is never one without the other. At rest
nothing can be read: of the key a derived value is stored, and the answer, which may hold secrets
that are shown once, is sealed under another value derived from the same key.
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
    Executable,
    Index,
    LargeBinary,
    MetaData,
    Table,
    Text,
    bindparam,
    select,
)
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.dialects.postgresql import Insert

from skyway.errors import InvalidInput
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database, Tx
from skyway.runtime.engines import Dialect
from skyway.runtime.errors import IdempotencyKeyReused
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

_THIS: Final = _KEYS.c.key_hash == bindparam("this")
_FIND: Final = select(_KEYS.c.body_hash, _KEYS.c.answer).where(_THIS)
_REMEMBER: Final = _KEYS.update().where(_THIS)


def _taking(insert: Insert) -> Executable:
    """Take a key that nobody has, or whose day is over."""
    new = insert.excluded
    return insert.on_conflict_do_update(
        index_elements=[_KEYS.c.key_hash],
        set_={"body_hash": new.body_hash, "answer": None, "created_at_ms": new.created_at_ms},
        where=_KEYS.c.created_at_ms <= bindparam("forgotten_ms", type_=BigInteger),
    )


#: The two classes share what is used of them.
_TAKE: Final[Mapping[Dialect, Executable]] = {
    "postgresql": _taking(postgresql.insert(_KEYS)),
    "sqlite": _taking(sqlite.insert(_KEYS)),  # type: ignore[arg-type]
}


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
    try:
        async with db.write() as tx:
            if key is None:
                return _unless_failed(await act(tx))
            note = _Note.derive(caller, route, key)
            now_ms = moment_to_ms(clock.wall_now())
            if not await _is_first(tx, note, body=body, now_ms=now_ms):
                return await _recall(tx, note, body=body)
            answer = _unless_failed(await act(tx))
            sealed = {"this": note.key_hash, "answer": note.seal(answer)}
            await tx.execute(_REMEMBER, sealed)
            return answer
    except _Failed as failed:
        return failed.answer


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


async def _is_first(tx: Tx, note: _Note, *, body: bytes, now_ms: int) -> bool:
    """Take the key; a caller that comes at the same time waits here for our COMMIT."""
    row = {
        "key_hash": note.key_hash,
        "body_hash": note.body_hash(body),
        "created_at_ms": now_ms,
        "forgotten_ms": now_ms - _KEPT_MS,
    }
    return (await tx.execute(_TAKE[tx.dialect], row)).rowcount == 1


async def _recall(tx: Tx, note: _Note, *, body: bytes) -> Answer:
    row = (await tx.execute(_FIND, {"this": note.key_hash})).one()
    if not hmac.compare_digest(row.body_hash, note.body_hash(body)):
        raise IdempotencyKeyReused
    return note.unseal(row.answer)
