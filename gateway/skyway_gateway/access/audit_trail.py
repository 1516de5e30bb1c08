"""Writes the audit log: calls of operators and providers, keys, tracking links, refused keys.

Calls that only read are not logged. The entry is written before the answer is sent, so that no
answered call is missing. The key identifies the caller; a call that it refuses changes nothing.

At most one entry is written for each key that has ended, or else for each address, and minute, and
at most 60 entries in a minute by all replicas together. These entries are written a moment after
the answer, so the answer shows nothing of the work.
"""

import json
import logging
from collections.abc import Awaitable, Callable, MutableMapping
from http import HTTPMethod
from typing import Any, Final, get_args

from skyway.ids import SubjectId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.http.identity import Caller, RefusalReason, RefusedKey
from skyway.runtime.loops import Wake
from skyway.runtime.metrics import count
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway.runtime.tracing import current_traceparent
from skyway_gateway.access import audit_store
from skyway_gateway.access.audit_store import (
    LONGEST_BODY,
    UNKNOWN,
    AuditEntry,
    RefusedLogin,
    body_text,
    path_text,
)

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

_KEYS: Final = "/v1/keys"


def _is_right(path: str) -> bool:
    """Whether a customer's call gives or takes a right, which the log knows too."""
    return path.endswith(TRACKING_LINK) or path.startswith(_KEYS)


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
            or (caller.role == "customer" and _is_right(scope["path"]))
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
            body=body_text(body, path=scope["path"]),
            traceparent=current_traceparent(),
        )
        try:
            async with self._db.write() as tx:
                await audit_store.add(tx, entry)
        except ServiceUnavailable:
            # The call has had its effect: it must not be answered as a failure.
            count("skyway_audit_lost", "calls that could not be logged")
            log.exception("audit entry lost", extra={"entry": entry.model_dump(mode="json")})


#: Entries of one minute, of all replicas together.
MOST_A_MINUTE: Final = 60
#: Entries that wait while the database is away; there are not more in memory.
_MOST_WAITING: Final = 10 * MOST_A_MINUTE

_MINUTE_S: Final = 60
_STATUS: Final = 401

#: An unknown caller chooses the text of the method.
_METHODS: Final = frozenset(HTTPMethod)
_OTHER: Final = "OTHER"


class RefusedLogins:
    """Notes refused keys; `write` is a step of a loop."""

    def __init__(self, db: Database, clock: FleetClock, mint: Mint) -> None:
        self._db = db
        self._clock = clock
        self._mint = mint
        self._minute = 0
        #: What was noted of this minute.
        self._noted: set[str] = set()
        self._waiting: list[RefusedLogin] = []
        #: Set when an entry waits.
        self.wake = Wake()
        for reason in get_args(RefusalReason):
            count("skyway_keys_refused", "keys that were refused", 0, reason=reason)
        count("skyway_audit_lost", "calls that could not be logged", 0)

    def note(self, refused: RefusedKey, *, method: str, path: str, address: str) -> None:
        """Count a refused key, and have it written unless its minute has an entry of it."""
        count("skyway_keys_refused", "keys that were refused", reason=refused.reason)
        minute = int(self._clock.wall_now().timestamp()) // _MINUTE_S
        if minute != self._minute:
            self._minute, self._noted = minute, set()
        key_id = None if refused.holder is None else refused.holder.key_id
        source = f"address {address}" if key_id is None else f"key {key_id}"
        if source in self._noted or len(self._noted) >= MOST_A_MINUTE:
            return
        if len(self._waiting) >= _MOST_WAITING:
            count("skyway_audit_lost", "calls that could not be logged")
            return
        self._noted.add(source)
        known_method = method if method in _METHODS else _OTHER
        entry = self._entry(refused, known_method, path_text(path, b""), address)
        self._waiting.append(RefusedLogin(entry, minute, source))
        self.wake.set()

    async def write(self) -> bool:
        """One step of the loop: write the entries that wait, except those of another replica."""
        while self._waiting:
            login = self._waiting.pop(0)
            try:
                async with self._db.write() as tx:
                    await audit_store.add_refused(tx, login, most=MOST_A_MINUTE)
            except ServiceUnavailable:
                self._waiting.insert(0, login)
                raise
        return False

    def _entry(self, refused: RefusedKey, method: str, path: str, address: str) -> AuditEntry:
        holder = refused.holder
        caller = None if holder is None else holder.caller
        role = UNKNOWN if caller is None else audit_store.ROLES.get(caller.role, UNKNOWN)
        about = {
            "refused": refused.reason,
            "address": address,
            "key_id": None if holder is None else holder.key_id,
        }
        return AuditEntry(
            entry_id=self._mint("aud"),
            at=self._clock.now(),
            wall_at=self._clock.wall_now(),
            role=role,
            subject_id=SubjectId(UNKNOWN if caller is None else caller.subject_id),
            method=method,
            path=path,
            status=_STATUS,
            body=json.dumps(about),
            traceparent=current_traceparent(),
        )
