"""W3C trace context, logs as JSON lines on standard error, and the last errors of the process.

One `traceparent` follows a request through REST, messages and logs. `LAST_ERRORS` keeps the newest
warning or error of each kind for operators.

In deployments that name a collector (`SKYWAY_OTLP_ENDPOINT`), a thread of its own sends spans
there, many in one request. When the collector is slow or away, spans are dropped: nothing waits for
it.
"""

import atexit
import json
import logging
import re
import secrets
import sys
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Final

from skyway.contracts.figures import LoggedError
from skyway.runtime.errors import InvalidSettings

_TRACEPARENT = re.compile(r"([0-9a-f]{2})-([0-9a-f]{32})-([0-9a-f]{16})-([0-9a-f]{2})(-.*)?")
_NO_TRACE = "0" * 32
_NO_SPAN = "0" * 16
_SAMPLED = "01"

#: The name of a span, or a function that names it at its end.
SpanName = str | Callable[[], str]


@dataclass(frozen=True, slots=True)
class FinishedSpan:
    """A piece of work in a trace: its begin and end, ns since 1970.

    `parent_id` is the span that caused it; None if this span began the trace.
    """

    name: str
    trace_id: str
    span_id: str
    parent_id: str | None
    began_ns: int
    ended_ns: int
    has_failed: bool


class SpanLog:
    """Where the spans of this process go when they end; usually nowhere."""

    recorder: Callable[[FinishedSpan], None] | None = None


#: The spans of this process.
SPANS: Final = SpanLog()

_current: ContextVar[str | None] = ContextVar("skyway_traceparent", default=None)

#: The attributes of every record, without added fields.
_PLAIN = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "taskName"}

#: Members whose name holds one of these are never written.
_SECRET_WORDS = ("password", "secret", "token", "authorization", "api_key", "bearer")


def current_traceparent() -> str | None:
    """The traceparent of the work in this task; None outside of any trace."""
    return _current.get()


def current_trace_id() -> str | None:
    """The trace id of the work in this task, 32 hex digits."""
    traceparent = _current.get()
    return None if traceparent is None else trace_id_of(traceparent)


def trace_id_of(traceparent: str | None) -> str | None:
    """The trace id in a traceparent; None if there is no valid one."""
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
def tracing(received: str | None, name: SpanName = "work") -> Iterator[str]:
    """Continue the trace of a received traceparent, under a span of our own; or begin one.

    Within the block, `current_traceparent` is what outgoing calls, messages and logs carry. `name`
    says what is done there.
    """
    trace_id = trace_id_of(received)
    traceparent = (
        new_traceparent()
        if received is None or trace_id is None
        else f"00-{trace_id}-{secrets.token_hex(8)}-{received[53:55]}"
    )
    token, began_ns, has_failed = _current.set(traceparent), time.time_ns(), True
    try:
        yield traceparent
        has_failed = False
    finally:
        _current.reset(token)
        if SPANS.recorder is not None and int(traceparent[53:55], 16) & 1:
            parent_id = None if received is None or trace_id is None else received[36:52]
            SPANS.recorder(
                FinishedSpan(
                    name if isinstance(name, str) else name(),
                    traceparent[3:35],
                    traceparent[36:52],
                    parent_id,
                    began_ns,
                    time.time_ns(),
                    has_failed,
                )
            )


@contextmanager
def in_trace_of(stored: str | None, name: SpanName = "work") -> Iterator[None]:
    """Run the block in the trace of a stored traceparent, under a span of our own.

    The traceparent that is stored with a delivery is that of its request. Without a stored
    traceparent, or if its trace is already current, nothing changes.
    """
    if stored is None or trace_id_of(stored) == current_trace_id():
        yield
        return
    with tracing(stored, name):
        yield


class JsonLines(logging.Formatter):
    """One JSON object per record; the values in `extra` become members."""

    def __init__(self, service: str) -> None:
        super().__init__()
        self._service = service

    def format(self, record: logging.LogRecord) -> str:
        """The record as one line."""
        moment = datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds")
        line: dict[str, object] = {
            "at": moment.replace("+00:00", "Z"),
            "level": record.levelname,
            "service": self._service,
            "logger": record.name,
            "event": record.getMessage(),
        }
        trace_id = current_trace_id()
        if trace_id is not None:
            line["trace_id"] = trace_id
        for name, value in vars(record).items():
            if name not in _PLAIN and not name.startswith("_"):
                line[name] = "***" if _is_secret(name) else value
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str, ensure_ascii=False)


def configure_logs(service: str, level: str, *, handler: logging.Handler | None = None) -> None:
    """Write all records from `level` on as JSON lines to `handler`, else to standard error."""
    handler = handler or logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines(service))
    logging.basicConfig(level=level.upper(), handlers=[handler], force=True)
    logging.captureWarnings(capture=True)
    # httpx logs each request to another service. That service logs the request itself.
    logging.getLogger("httpx").setLevel(logging.WARNING)
    # Alembic logs each migration and each plugin, which would hide our own lines of the start.
    logging.getLogger("alembic").setLevel(logging.WARNING)


def _is_secret(name: str) -> bool:
    return any(word in name.lower() for word in _SECRET_WORDS)


#: Kinds that are kept. One kind is one text in the code, with any values filled in.
MOST_KINDS: Final = 20
#: Characters of a text that are kept.
_LONGEST_TEXT: Final = 300


class LastErrors(logging.Handler):
    """Counts log records from WARNING on by kind, and keeps the newest record of each kind."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._kinds: OrderedDict[tuple[str, str], LoggedError] = OrderedDict()
        # Records come from other threads too.
        self._guard = threading.Lock()

    def emit(self, record: logging.LogRecord) -> None:
        """Note a record; with too many kinds, the kind with the oldest record is forgotten."""
        try:
            self._note(record)
        except (TypeError, ValueError, KeyError):
            # A text whose values do not fit is reported, and does not stop the work.
            self.handleError(record)

    def _note(self, record: logging.LogRecord) -> None:
        kind = (record.name, str(record.msg))
        with self._guard:
            earlier = self._kinds.pop(kind, None)
            self._kinds[kind] = LoggedError(
                wall_at=datetime.fromtimestamp(record.created, UTC),
                level=record.levelname,
                event=record.getMessage()[:_LONGEST_TEXT],
                reason=_reason_of(record),
                times=1 if earlier is None else earlier.times + 1,
                trace_id=current_trace_id(),
            )
            if len(self._kinds) > MOST_KINDS:
                self._kinds.popitem(last=False)

    def newest(self) -> Sequence[LoggedError]:
        """The newest record of each kind, the newest kind first."""
        with self._guard:
            return tuple(reversed(self._kinds.values()))


def _reason_of(record: logging.LogRecord) -> str | None:
    error = record.exc_info[1] if record.exc_info else None
    return None if error is None else f"{type(error).__name__}: {error}"[:_LONGEST_TEXT]


#: The warnings and errors of this process.
LAST_ERRORS: Final = LastErrors()


@dataclass(frozen=True, slots=True)
class SpanExport:
    """The export of the spans of this process, until it is closed."""

    processor: Any  # OpenTelemetry's BatchSpanProcessor, whose methods have no types

    def close(self) -> None:
        """Send the spans that wait, and export no others."""
        SPANS.recorder = None
        self.processor.shutdown()


def export_spans(service: str, endpoint: str) -> SpanExport:
    """Send the spans of this process to a collector: OTLP over HTTP, as protobuf.

    Raises
    ------
    InvalidSettings
        OpenTelemetry is not installed.
    """
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.sdk.resources import Resource
        from opentelemetry.sdk.trace import ReadableSpan
        from opentelemetry.sdk.trace.export import BatchSpanProcessor
        from opentelemetry.trace import SpanContext, Status, StatusCode, TraceFlags
    except ImportError as error:
        detail = "SKYWAY_OTLP_ENDPOINT needs OpenTelemetry: pip install 'skyway[otlp]'"
        raise InvalidSettings(detail) from error
    resource = Resource.create({"service.name": f"skyway-{service}"})
    processor = BatchSpanProcessor(OTLPSpanExporter(endpoint=endpoint))

    def context(trace_id: str, span_id: str) -> SpanContext:
        sampled = TraceFlags(TraceFlags.SAMPLED)
        return SpanContext(
            int(trace_id, 16), int(span_id, 16), is_remote=False, trace_flags=sampled
        )

    def record(span: FinishedSpan) -> None:
        status = Status(StatusCode.ERROR if span.has_failed else StatusCode.UNSET)
        parent = None if span.parent_id is None else context(span.trace_id, span.parent_id)
        processor.on_end(
            ReadableSpan(
                span.name,
                context(span.trace_id, span.span_id),
                parent,
                resource,
                status=status,
                start_time=span.began_ns,
                end_time=span.ended_ns,
            )
        )

    SPANS.recorder = record
    export = SpanExport(processor)
    atexit.register(export.close)
    return export
