"""How `ServiceClient` reaches a service over TCP: kept connections, one request at a time on each.

httpx's own transport takes 1.8 ms of processor time a request, most of it in going through its
pool and its layers for every kind of event loop; services ask each other a dozen times for a
delivery. This one speaks HTTP/1.1 over asyncio's streams and takes a quarter of that.
"""

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import AsyncIterator, Iterator
from typing import Final

import h11
import httpx

#: Servers close what was silent for 5 s; a request must not meet that.
_KEPT_S: Final = 4.0
_MOST_KEPT: Final = 20
_MOST: Final = 100
_READ_BYTES: Final = 64 * 1024

Origin = tuple[str, str, int]


class HttpTransport(httpx.AsyncBaseTransport):
    """A pool of connections to whom its requests name; raises httpx's own errors."""

    def __init__(self) -> None:
        self._kept: dict[Origin, deque[_Connection]] = {}
        self._free = asyncio.Semaphore(_MOST)

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        """The answer with its head read; its body is read from the connection, which it holds."""
        timeouts: dict[str, float | None] = request.extensions.get("timeout", {})
        with _as(httpx.PoolTimeout):
            async with asyncio.timeout(timeouts.get("pool")):
                await self._free.acquire()
        try:
            connection = await self._connection(request.url, timeouts.get("connect"))
            try:
                await connection.send(request, timeouts.get("write"))
                head = await connection.head(timeouts.get("read"))
            except BaseException:
                connection.close()
                raise
        except BaseException:
            self._free.release()
            raise
        return httpx.Response(
            head.status_code,
            headers=list(head.headers.raw_items()),
            stream=_Body(self, connection, timeouts.get("read")),
            request=request,
        )

    async def aclose(self) -> None:
        """Close what is kept."""
        for kept in self._kept.values():
            while kept:
                kept.popleft().close()

    def give_back(self, connection: "_Connection") -> None:
        """Keep a connection whose answer was read to its end; close any other."""
        self._free.release()
        kept = self._kept.setdefault(connection.origin, deque(maxlen=_MOST_KEPT))
        if not connection.begin_anew() or len(kept) == _MOST_KEPT:
            connection.close()
        else:
            kept.append(connection)

    async def _connection(self, url: httpx.URL, timeout_s: float | None) -> "_Connection":
        """The connection used last, the least likely to be closed meanwhile; else a new one."""
        origin = (url.scheme, url.host, url.port or (443 if url.scheme == "https" else 80))
        kept = self._kept.get(origin)
        while kept:
            connection = kept.pop()
            if connection.is_usable():
                return connection
            connection.close()
        scheme, host, port = origin
        with _as(httpx.ConnectTimeout, httpx.ConnectError):
            async with asyncio.timeout(timeout_s):
                streams = await asyncio.open_connection(host, port, ssl=scheme == "https" or None)
        return _Connection(origin, *streams)


class _Connection:
    """One connection; what it reads and writes is framed by h11."""

    def __init__(
        self, origin: Origin, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self.origin = origin
        self._reader = reader
        self._writer = writer
        self._http = h11.Connection(h11.CLIENT)
        self._kept_at_s = 0.0

    async def send(self, request: httpx.Request, timeout_s: float | None) -> None:
        """Send head and body, in one write when the body is at hand."""
        head = h11.Request(
            method=request.method, target=request.url.raw_path, headers=request.headers.raw
        )
        # A server that has heard enough answers and closes: its answer is still to be read.
        with _as(httpx.WriteTimeout), contextlib.suppress(ConnectionError):
            async with asyncio.timeout(timeout_s):
                waiting = self._http.send(head) or b""
                if not isinstance(request.stream, httpx.AsyncByteStream):
                    raise TypeError("a service's client sends asynchronously")
                async for part in request.stream:
                    self._writer.write(waiting + (self._http.send(h11.Data(part)) or b""))
                    waiting = b""
                    await self._writer.drain()
                self._writer.write(waiting + (self._http.send(h11.EndOfMessage()) or b""))
                await self._writer.drain()

    async def head(self, timeout_s: float | None) -> h11.Response:
        """The head of the answer."""
        while True:
            event = await self._next(timeout_s)
            if isinstance(event, h11.Response):
                return event

    async def parts(self, timeout_s: float | None) -> AsyncIterator[bytes]:
        """The body of the answer."""
        while True:
            event = await self._next(timeout_s)
            if isinstance(event, h11.Data):
                yield bytes(event.data)
            elif isinstance(event, h11.EndOfMessage | h11.ConnectionClosed):
                return

    def begin_anew(self) -> bool:
        """Make ready for another request; False when both sides are not done with this one."""
        if self._http.our_state is not h11.DONE or self._http.their_state is not h11.DONE:
            return False
        self._http.start_next_cycle()
        self._kept_at_s = time.monotonic()
        return True

    def is_usable(self) -> bool:
        """Whether the other side is thought to be still there."""
        is_fresh = time.monotonic() - self._kept_at_s < _KEPT_S
        return is_fresh and not self._reader.at_eof() and not self._writer.is_closing()

    def close(self) -> None:
        """Close without waiting for the other side."""
        self._writer.close()

    async def _next(self, timeout_s: float | None) -> h11.Event | type[h11.PAUSED]:
        with _as(httpx.ReadTimeout, httpx.ReadError, httpx.RemoteProtocolError):
            while (event := self._http.next_event()) is h11.NEED_DATA:
                async with asyncio.timeout(timeout_s):
                    self._http.receive_data(await self._reader.read(_READ_BYTES))
        return event  # type: ignore[return-value]  # NEED_DATA has been waited out


class _Body(httpx.AsyncByteStream):
    """The rest of an answer; closing it gives its connection back."""

    def __init__(
        self, transport: HttpTransport, connection: _Connection, timeout_s: float | None
    ) -> None:
        self._transport = transport
        self._connection: _Connection | None = connection
        self._timeout_s = timeout_s

    async def __aiter__(self) -> AsyncIterator[bytes]:
        if self._connection is not None:
            async for part in self._connection.parts(self._timeout_s):
                yield part

    async def aclose(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            self._transport.give_back(connection)


@contextlib.contextmanager
def _as(
    late: type[httpx.TimeoutException],
    broken: type[httpx.TransportError] | None = None,
    unreadable: type[httpx.TransportError] | None = None,
) -> Iterator[None]:
    """Raise what went wrong as httpx's own error."""
    try:
        yield
    except TimeoutError as error:
        raise late(str(error)) from error
    except OSError as error:
        if broken is None:
            raise
        raise broken(str(error)) from error
    except h11.RemoteProtocolError as error:
        if unreadable is None:
            raise
        raise unreadable(str(error)) from error
