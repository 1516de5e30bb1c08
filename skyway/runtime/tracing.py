"""W3C trace context: one `traceparent` follows a request through REST, messages and logs."""

import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_TRACEPARENT = re.compile(r"([0-9a-f]{2})-([0-9a-f]{32})-([0-9a-f]{16})-([0-9a-f]{2})(-.*)?")
_NO_TRACE = "0" * 32
_NO_SPAN = "0" * 16
_SAMPLED = "01"

_current: ContextVar[str | None] = ContextVar("skyway_traceparent", default=None)


def current_traceparent() -> str | None:
    """The traceparent of the work going on in this task, or None outside of any trace."""
    return _current.get()


def current_trace_id() -> str | None:
    """The trace id of the work going on in this task, 32 hex digits."""
    traceparent = _current.get()
    return None if traceparent is None else trace_id_of(traceparent)


def trace_id_of(traceparent: str | None) -> str | None:
    """The trace id in a traceparent, or None when it is missing or not one."""
    found = _TRACEPARENT.fullmatch(traceparent or "")
    if found is None:
        return None
    version, trace_id, span_id, _flags, more = found.groups()
    # Version ff is forbidden, and only versions after 00 may carry further members.
    is_valid = version != "ff" and not (version == "00" and more)
    return trace_id if is_valid and trace_id != _NO_TRACE and span_id != _NO_SPAN else None


def new_traceparent() -> str:
    """The traceparent of a new trace."""
    return f"00-{secrets.token_hex(16)}-{secrets.token_hex(8)}-{_SAMPLED}"


@contextmanager
def tracing(received: str | None) -> Iterator[str]:
    """Continue the trace of a received traceparent, under a span of our own; or begin one.

    Within the block, `current_traceparent` is what outgoing calls, messages and logs carry.
    """
    trace_id = trace_id_of(received)
    traceparent = (
        new_traceparent()
        if received is None or trace_id is None
        else f"00-{trace_id}-{secrets.token_hex(8)}-{received[53:55]}"
    )
    token = _current.set(traceparent)
    try:
        yield traceparent
    finally:
        _current.reset(token)
