"""The same Idempotency-Key, the same effect and the same answer, for a day.

The key is noted with the answer, once the act is done and in its transaction, so there is never one
without the other. An act whose key turns out to be known is undone. One that fails is looked up
too: what makes it fail may be that it was done before. At rest nothing can be read: of the key a
derived value is stored, and the answer, which may hold secrets that are shown once, is sealed
under another value derived from the same key.
"""

from collections.abc import Awaitable, Callable
from typing import Final

from skyway.errors import SkywayError
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Taken
from skyway.runtime.idempotency.answer import Answer
from skyway.runtime.idempotency.memory import Memory
from skyway.runtime.idempotency.note import Note
from skyway.runtime.sql.database import Database, Tx

_FIRST_SERVER_ERROR: Final = 500

#: The rule that refuses a key that is known.
_ONE_ANSWER: Final = "idempotency_pkey"

#: What a request does, inside the transaction it is given.
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
    memory = None if key is None else Memory(Note.derive(caller, route, key), body, clock)
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


async def _act(db: Database, act: Act, memory: Memory | None) -> Answer:
    async with db.write() as tx:
        answer = _unless_failed(await act(tx))
        if memory is not None:
            memory.keep(tx, answer)
    return answer


class _Failed(Exception):
    """Leaves the write block, and so undoes it, with an answer of the server's own failure."""

    def __init__(self, answer: Answer) -> None:
        super().__init__(answer.status)
        self.answer = answer


def _unless_failed(answer: Answer) -> Answer:
    if answer.status >= _FIRST_SERVER_ERROR:
        raise _Failed(answer)
    return answer
