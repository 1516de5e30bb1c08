"""Logs the calls of operators and providers, and customers' changes of tracking links.

Calls that only read are not logged.

The entry is written before the answer is sent, so that no answered call is missing. The key
identifies the caller; a call that it refuses changes nothing and has no entry.
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
from skyway_gateway.access import audit_store
from skyway_gateway.access.audit_store import LONGEST_BODY, AuditEntry, body_text, path_text

log = logging.getLogger(__name__)

#: The types of ASGI, whose messages have members of every type.
_Message = MutableMapping[str, Any]
_Receive = Callable[[], Awaitable[_Message]]
_Send = Callable[[_Message], Awaitable[None]]
_App = Callable[[_Message, _Receive, _Send], Awaitable[None]]

#: Methods that change nothing.
_READING: Final = frozenset({"GET", "HEAD", "OPTIONS"})
_NOT_ANSWERED: Final = 0

#: How the paths of tracking links end. The log is the second copy of which link was withdrawn.
TRACKING_LINK: Final = "/tracking-link"


class AuditTrail:
    """ASGI middleware: one entry for each call of an operator or provider."""

    def __init__(self, app: _App, *, db: Database, clock: FleetClock, mint: Mint) -> None:
        self._app = app
        self._db = db
        self._clock = clock
        self._mint = mint

    async def __call__(self, scope: _Message, receive: _Receive, send: _Send) -> None:
        """Pass a call on, and log it when it is answered."""
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
        if not isinstance(caller, Caller) or not (
            caller.role in ("operator", "provider")
            or (caller.role == "customer" and scope["path"].endswith(TRACKING_LINK))
        ):
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
                await audit_store.add(tx, entry)
        except ServiceUnavailable:
            # The call has had its effect: it must not be answered as a failure.
            count("skyway_audit_lost", "calls that could not be logged")
            log.exception("audit entry lost", extra={"entry": entry.model_dump(mode="json")})
