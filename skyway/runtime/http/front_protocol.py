"""uvicorn's protocol with limits: too large or too slow requests end before they are collected.

uvicorn itself only limits the connections of a process and the silence between requests.
"""

import json
import socket
from asyncio import AbstractEventLoop, TimerHandle, Transport
from http import HTTPStatus
from typing import Any, Final

import httptools
from uvicorn.config import Config
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.server import ServerState

from skyway.contracts.problem_details import PROBLEM_MEDIA_TYPE
from skyway.runtime.http.client_disconnect import CALLER_GONE
from skyway.runtime.http.front_limits import ConnectionTable, FrontLimits
from skyway.runtime.http.request_form import FirstLine, is_understood_alike
from skyway.runtime.metrics import count

#: Linux only: on other systems a caller counts as present until something is read.
_TCP_INFO: Final[int | None] = getattr(socket, "TCP_INFO", None)
#: The state of a connection that neither side has closed (Linux, tcp_states.h).
_ESTABLISHED: Final = 1

#: How long a refused caller may go on sending before its connection is cut, seconds.
_LINGER_S: Final = 1.0
#: A chunked body may have so many bytes around each of its bytes.
_FRAMING_PER_BYTE: Final = 8


class _Refused(Exception):
    """Ends the parsing of a request."""


class FrontProtocol(HttpToolsProtocol):
    """One connection.

    It waits for the head, then for the body, then for the app's answer. A timer runs while the
    caller must act: send the head, send the body, or read the answer. A request that comes before
    the last one is answered is not read, because the parser does not show how it is written: the
    connection ends with the answer to the last one.
    """

    def __init__(
        self,
        config: Config,
        server_state: ServerState,
        app_state: dict[str, Any],  # the state of the app's lifespan, as uvicorn passes it on
        _loop: AbstractEventLoop | None = None,
        *,
        limits: FrontLimits,
        table: ConnectionTable,
    ) -> None:
        super().__init__(config, server_state, app_state, _loop)
        self._limits = limits
        self._table = table
        self._name: str | None = None
        self._is_refused = False
        self._is_in_head = False
        self._is_in_body = False
        self._may_begin = self._began_in_this_part = self._is_early = False
        self._refusal: HTTPStatus | None = None
        self._head_bytes = self._header_lines = self._body_bytes = self._framed_bytes = 0
        self._dropped_bytes = 0
        self._first_line = FirstLine()
        self._body_since_s = 0.0
        self._caller_timer: TimerHandle | None = None
        self._reading_timer: TimerHandle | None = None

    # The connection.

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]  # as uvicorn
        """Accept the connection if there is room for it."""
        super().connection_made(transport)
        host = self.client[0] if self.client else ""
        self._name = self._table.enter(self, host)
        if self._name is None:
            self._is_refused = True
            transport.abort()
        else:
            self._arm(self._limits.head_s)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._disarm()
        if self._reading_timer is not None:
            self._reading_timer.cancel()
        if self._name is not None:
            self._table.leave(self, self._name)
            self._name = None
        super().connection_lost(exc)

    def close_waiting(self) -> None:
        """Make room for another connection."""
        name, self._name = self._name, None
        if name is not None:
            self._table.leave(self, name)
        self._is_refused = True
        self.transport.abort()

    # What comes in.

    def data_received(self, data: bytes) -> None:
        """Parse a part of what the caller sends."""
        self._unset_keepalive_if_required()
        if self._is_refused:
            self._drop(len(data))
            return
        was_in_body, self._began_in_this_part = self._is_in_body, False
        self._may_begin = self._is_answered and not self._is_in_head and not self._is_in_body
        if self._may_begin:
            self._first_line = FirstLine()
        if not self._first_line.goes_on_well(data):
            self._refuse(HTTPStatus.BAD_REQUEST)
            return
        try:
            self.parser.feed_data(data)
        except httptools.HttpParserUpgrade:
            pass  # an Upgrade is ignored, and the request is answered
        except httptools.HttpParserError:
            if self._is_early:
                self._is_refused = True
                self.shutdown()  # once the last request is answered
                return
            self._refuse(self._refusal or HTTPStatus.BAD_REQUEST)
            return
        self._count_unparsed(len(data), was_in_body=was_in_body)
        if not self._is_refused and self._caller_timer is None:
            self._time_caller()

    def is_caller_gone(self) -> bool:
        """Whether the caller has closed its side; reading alone would notice that too late."""
        opened = self.transport.get_extra_info("socket")
        if opened is None or self.transport.is_closing():
            return True
        if _TCP_INFO is None:
            return False
        try:
            info: bytes = opened.getsockopt(socket.IPPROTO_TCP, _TCP_INFO, 1)
        except OSError:
            return True
        return info[0] != _ESTABLISHED

    @property
    def _is_answered(self) -> bool:
        """Whether the caller may have the whole answer to its last request."""
        cycle = self.cycle
        if cycle is None or cycle.response_complete:
            return True
        is_counted = cycle.response_started and not cycle.chunked_encoding
        return is_counted and cycle.expected_content_length == 0

    def on_message_begin(self) -> None:
        """Begin to count a request, unless it begins before the last one is answered."""
        if not self._may_begin:
            self._is_early = True
            raise _Refused
        self._may_begin = False
        super().on_message_begin()
        self.scope["extensions"] = {CALLER_GONE: {"is_gone": self.is_caller_gone}}
        self._is_in_head = self._began_in_this_part = True
        self._head_bytes = self._header_lines = self._body_bytes = self._framed_bytes = 0

    def on_url(self, url: bytes) -> None:
        """Collect the URL, up to its limit."""
        if len(self.url) + len(url) > self._limits.url_bytes:
            self._end(HTTPStatus.REQUEST_URI_TOO_LONG)
        super().on_url(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        """Collect a header; count a trailer and drop it, because it could name another caller."""
        self._header_lines += 1
        self._head_bytes += len(name) + len(value) + 4
        if (
            self._header_lines > self._limits.header_lines
            or self._head_bytes > self._limits.head_bytes
        ):
            self._end(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE)
        if self._is_in_head:
            super().on_header(name, value.strip(b" \t"))

    def on_headers_complete(self) -> None:
        """Hand the request to the app, if it can be understood in one way only."""
        if not is_understood_alike(self.url, self.headers, self.parser.get_http_version()):
            self._end(HTTPStatus.BAD_REQUEST)
        self._is_in_head, self._is_in_body = False, True
        self._disarm()
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        """Hand a part of the body to the app, or drop it if the app has answered already."""
        self._body_bytes += len(body)
        if self.cycle.response_complete:
            self._drop(len(body))
        super().on_body(body)

    def on_message_complete(self) -> None:
        """Note that the request has come as a whole."""
        self._is_in_body = False
        self._disarm()
        if self._name is not None and not self.cycle.response_complete:
            self._table.use(self, self._name)
        super().on_message_complete()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        if self._name is not None and not self.pipeline:
            self._table.wait(self, self._name)
        super().on_response_complete()

    # What goes out.

    def pause_writing(self) -> None:
        """Stop writing, and give the caller some time to read."""
        super().pause_writing()
        if self._reading_timer is None:
            self._reading_timer = self.loop.call_later(self._limits.unread_s, self._cut, "unread")

    def resume_writing(self) -> None:
        """Go on: the caller reads."""
        super().resume_writing()
        if self._reading_timer is not None:
            self._reading_timer.cancel()
            self._reading_timer = None

    # Limits.

    def _end(self, status: HTTPStatus) -> None:
        """Refuse the request from inside the parser."""
        self._refusal = status
        raise _Refused

    def _refuse(self, status: HTTPStatus) -> None:
        """Answer with a problem, and close; only close if the app has begun an answer."""
        self._disarm()
        count("skyway_http_refused", "requests refused by their form", status=str(status.value))
        self._is_refused = True
        if self.transport.is_closing():
            return
        if self.cycle is not None and not self.cycle.response_complete:
            if self.cycle.response_started or self.pipeline:
                self.transport.abort()
                return
            # The app learns that its caller has left.
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        self.transport.write(_problem(status))
        if self.transport.can_write_eof():
            self.transport.write_eof()
        # A connection that is cut while its caller sends would lose the answer.
        self.loop.call_later(_LINGER_S, self.transport.abort)

    def _drop(self, dropped_bytes: int) -> None:
        self._dropped_bytes += dropped_bytes
        if self._dropped_bytes > self._limits.dropped_bytes:
            self.transport.abort()

    def _count_unparsed(self, part_bytes: int, *, was_in_body: bool) -> None:
        """Count bytes that the parser still collects: half a header, or a chunk's frame."""
        if self._is_in_head and not self._began_in_this_part:
            self._head_bytes += part_bytes
            if self._head_bytes > self._limits.head_bytes:
                self._refuse(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE)
        elif was_in_body and self._is_in_body:
            self._framed_bytes += part_bytes
            most = self._limits.head_bytes + _FRAMING_PER_BYTE * self._body_bytes
            if self._framed_bytes - self._body_bytes > most:
                self._refuse(HTTPStatus.BAD_REQUEST)

    def _time_caller(self) -> None:
        """Start the timer for the next part that the caller must send."""
        if self._is_in_body:
            self._body_since_s = self.loop.time()
            self._arm(self._limits.body_s)
        elif self._is_in_head or self.cycle is None or self.cycle.response_complete:
            self._arm(self._limits.head_s)

    def _arm(self, delay_s: float) -> None:
        self._caller_timer = self.loop.call_later(delay_s, self._on_late)

    def _disarm(self) -> None:
        if self._caller_timer is not None:
            self._caller_timer.cancel()
            self._caller_timer = None

    def _on_late(self) -> None:
        """End the connection: the caller did not send the next part in time."""
        self._caller_timer = None
        if self._is_in_body:
            bonus_s = self._body_bytes / self._limits.slowest_body_bps
            left_s = self._body_since_s + self._limits.body_s + bonus_s - self.loop.time()
            # While we do not read, the caller is not to blame.
            if left_s > 0.0 or self.flow.read_paused:
                self._arm(max(left_s, 1.0))
                return
        elif not self._is_in_head and not (self.cycle is None or self.cycle.response_complete):
            return
        self._refuse(HTTPStatus.REQUEST_TIMEOUT)

    def _cut(self, reason: str) -> None:
        count("skyway_http_connections_closed", "connections closed to make room", reason=reason)
        self.transport.abort()


def _problem(status: HTTPStatus) -> bytes:
    """A whole answer with a problem document, as bytes."""
    name = status.phrase.lower().replace(" ", "-")
    problem = {"type": f"urn:skyway:problem:{name}", "title": status.phrase, "status": status.value}
    body = json.dumps(problem).encode()
    head = (
        f"HTTP/1.1 {status.value} {status.phrase}\r\ncontent-type: {PROBLEM_MEDIA_TYPE}\r\n"
        f"content-length: {len(body)}\r\nconnection: close\r\n\r\n"
    )
    return head.encode() + body
