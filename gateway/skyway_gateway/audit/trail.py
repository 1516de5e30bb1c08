"""Writes down what operators and providers do: each of their calls that is not a GET.

The entry is on disk before the answer is sent, so that no answered call is missing. The key gate
tells who is calling; where it let nobody in there is no entry, for nothing could be done.
"""

import logging
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any, Final

from skyway.ids import SubjectId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.http.identity import Caller
from skyway.runtime.metrics import count
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway.runtime.tracing import current_traceparent
from skyway_gateway.audit import store
from skyway_gateway.audit.entry import LONGEST_BODY, AuditEntry, body_text, path_text

log = logging.getLogger(__name__)

#: ASGI's own types; Any, since a message has members of every type.
_Message = MutableMapping[str, Any]
_Receive = Callable[[], Awaitable[_Message]]
_Send = Callable[[_Message], Awaitable[None]]
_App = Callable[[_Message, _Receive, _Send], Awaitable[None]]

#: These change nothing.
_READING: Final = frozenset({"GET", "HEAD", "OPTIONS"})
_NOT_ANSWERED: Final = 0


class AuditTrail:
    """ASGI middleware: one entry per call of a known operator or provider."""

    def __init__(self, app: _App, *, db: Database, clock: FleetClock, mint: Mint) -> None:
        self._app = app
        self._db = db
        self._clock = clock
        self._mint = mint

    async def __call__(self, scope: _Message, receive: _Receive, send: _Send) -> None:
        """Pass a call on, and write it down when it is answered."""
        if scope["type"] != "http" or scope["method"] in _READING:
            await self._app(scope, receive, send)
            return
        state = scope.setdefault("state", {})
        body = bytearray()
        is_written = False

        async def read() -> _Message:
            message = await receive()
            body.extend(message.get("body", b"")[: LONGEST_BODY - len(body)])
            return message

        async def answer(message: _Message) -> None:
            nonlocal is_written
            if message["type"] == "http.response.start":
                is_written = True
                await self._write(scope, state.get("caller"), bytes(body), message["status"])
            await send(message)

        try:
            await self._app(scope, read, answer)
        finally:
            if not is_written:
                await self._write(scope, state.get("caller"), bytes(body), _NOT_ANSWERED)

    async def _write(self, scope: _Message, caller: object, body: bytes, status: int) -> None:
        if not isinstance(caller, Caller) or caller.role not in ("operator", "provider"):
            return
        entry = AuditEntry(
            entry_id=self._mint("aud"),
            at=self._clock.now(),
            wall_at=self._clock.wall_now(),
            role=caller.role,
            subject_id=SubjectId(caller.subject_id),
            method=scope["method"],
            path=path_text(scope["path"], scope["query_string"]),
            status=status,
            body=body_text(body),
            traceparent=current_traceparent(),
        )
        try:
            async with self._db.write() as tx:
                await store.add(tx, entry)
        except ServiceUnavailable:
            # It is done, wherever it was done: the caller must not be told otherwise.
            count("skyway_audit_lost", "calls that could not be written down")
            log.exception("audit entry lost", extra={"entry": entry.model_dump(mode="json")})
