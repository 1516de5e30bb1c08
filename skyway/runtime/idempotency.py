"""The same Idempotency-Key gives the same effect and the same answer for a day.

The answer is stored under its key at the end of the act, in the transaction of the act. So both are
stored or neither is. If the key is stored already, the act is undone and the stored answer is given
again. After an act that fails, the stored answer is looked up too: the act may fail because it was
done before. Stored answers cannot be read without the key: only a hash that is derived from the key
is stored. The answer may hold secrets that are shown once, so it is sealed with another value
derived from the key.
"""

from collections.abc import Awaitable, Callable
from typing import Final

from skyway.errors import SkywayError
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import RowRefused
from skyway.runtime.idempotency_store import Answer, KeySecrets, StoredAnswer
from skyway.runtime.sql.database import Database, Tx

__all__ = ["Act", "Answer", "answered_before", "once"]

_FIRST_SERVER_ERROR: Final = 500

#: The rule of the database that refuses a key a second time.
_ONE_ANSWER: Final = "idempotency_pkey"

#: The act of a request, in the given transaction.
Act = Callable[[Tx], Awaitable[Answer]]


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
    stored = (
        None if key is None else StoredAnswer(KeySecrets.derive(caller, route, key), body, clock)
    )
    try:
        return await _act(db, act, stored)
    except (SkywayError, _Failed) as error:
        previous = None if stored is None else await stored.load(db)
        if previous is not None:
            return previous
        if stored is not None and isinstance(error, RowRefused) and error.constraint == _ONE_ANSWER:
            await stored.delete_if_expired(db)
            return await once(
                db, caller=caller, route=route, key=key, body=body, act=act, clock=clock
            )
        if isinstance(error, _Failed):
            return error.answer
        raise


async def answered_before(
    db: Database, *, caller: str, route: str, key: str | None, body: bytes, clock: FleetClock
) -> Answer | None:
    """The stored answer to this caller's same call; None without one, or without a key.

    A route that asks other services looks here first, so that a repeated call does not ask them
    again.

    Raises
    ------
    IdempotencyKeyReused, InvalidInput
        As for `once`.
    """
    if key is None:
        return None
    return await StoredAnswer(KeySecrets.derive(caller, route, key), body, clock).load(db)


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
