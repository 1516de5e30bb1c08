"""Logs as JSON lines on standard error: one event a line, with ids as members."""

import json
import logging
import sys
from datetime import UTC, datetime

from skyway.runtime.tracing import current_trace_id

#: The attributes of every record, without added fields.
_PLAIN = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "taskName"}

#: Members whose name holds one of these are never written.
_SECRET_WORDS = ("password", "secret", "token", "authorization", "api_key", "bearer")


class JsonLines(logging.Formatter):
    """One JSON object per record; what was given as `extra` becomes members."""

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


def configure_logs(service: str, level: str) -> None:
    """Write all records of this process, from `level` on, as JSON lines on standard error."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines(service))
    logging.basicConfig(level=level.upper(), handlers=[handler], force=True)
    logging.captureWarnings(capture=True)
    # httpx logs each request to another service. That service logs the request itself.
    logging.getLogger("httpx").setLevel(logging.WARNING)


def _is_secret(name: str) -> bool:
    return any(word in name.lower() for word in _SECRET_WORDS)
