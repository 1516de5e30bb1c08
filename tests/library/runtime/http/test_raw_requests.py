"""Raw forms of requests: what the front accepts, it understands as h11 does."""

from collections.abc import AsyncIterator
from random import Random
from typing import Final

import h11
import pytest
from starlette.types import Receive, Scope, Send

from skyway.runtime.http.front_limits import FrontLimits
from tests.library.runtime.http.test_front_protocol import Front

LIMITS = FrontLimits(
    connections=20, per_address=20, url_bytes=1_000, head_bytes=4_000, head_s=60.0, body_s=60.0
)
POST = b"POST /a?b=c HTTP/1.1\r\nHost: x\r\n"
GET = b"GET / HTTP/1.1\r\nHost: x\r\n"
CHUNKED = POST + b"Transfer-Encoding: chunked\r\n"

#: Requests, each whole, as a caller may send them.
FORMS: Final[dict[str, bytes]] = {
    "plain": GET + b"\r\n",
    "length": POST + b"Content-Length: 5\r\n\r\nhello",
    "length with zeros": POST + b"Content-Length: 0005\r\n\r\nhello",
    "length with plus": POST + b"Content-Length: +5\r\n\r\nhello",
    "length with minus": POST + b"Content-Length: -5\r\n\r\nhello",
    "length in hexadecimal": POST + b"Content-Length: 0x5\r\n\r\nhello",
    "length with space": POST + b"Content-Length: 5 5\r\n\r\nhello",
    "length with a comma": POST + b"Content-Length: 5, 5\r\n\r\nhello",
    "length with another": POST + b"Content-Length: 5, 6\r\n\r\nhello",
    "length twice the same": POST + b"Content-Length: 5\r\nContent-Length: 5\r\n\r\nhello",
    "length twice": POST + b"Content-Length: 5\r\nContent-Length: 6\r\n\r\nhello!",
    "length empty": POST + b"Content-Length:\r\n\r\n",
    "length huge": POST + b"Content-Length: " + b"9" * 40 + b"\r\n\r\n",
    "length underscore": POST + b"Content-Length: 1_0\r\n\r\nhello",
    "length of a GET": GET + b"Content-Length: 5\r\n\r\nhello",
    "length none": POST + b"\r\n",
    "length and chunks": CHUNKED + b"Content-Length: 3\r\n\r\n5\r\nhello\r\n0\r\n\r\n",
    "chunks and length": POST
    + b"Content-Length: 3\r\nTransfer-Encoding: chunked\r\n\r\n5\r\nhello\r\n0\r\n\r\n",
    "chunks": CHUNKED + b"\r\n5\r\nhello\r\n6\r\n world\r\n0\r\n\r\n",
    "chunks upper case": CHUNKED + b"\r\nA\r\n0123456789\r\n0\r\n\r\n",
    "chunk with zeros": CHUNKED + b"\r\n0005\r\nhello\r\n0\r\n\r\n",
    "chunk with 0x": CHUNKED + b"\r\n0x5\r\nhello\r\n0\r\n\r\n",
    "chunk with plus": CHUNKED + b"\r\n+5\r\nhello\r\n0\r\n\r\n",
    "chunk with minus": CHUNKED + b"\r\n-5\r\nhello\r\n0\r\n\r\n",
    "chunk with space": CHUNKED + b"\r\n5 \r\nhello\r\n0\r\n\r\n",
    "chunk with space before": CHUNKED + b"\r\n 5\r\nhello\r\n0\r\n\r\n",
    "chunk with extension": CHUNKED + b"\r\n5;a=b\r\nhello\r\n0\r\n\r\n",
    "chunk with quoted extension": CHUNKED + b'\r\n5;a="b;c"\r\nhello\r\n0\r\n\r\n',
    "chunk with a bare extension": CHUNKED + b"\r\n5;\r\nhello\r\n0\r\n\r\n",
    "chunk with newline in extension": CHUNKED + b"\r\n5;a\nhello\r\n0\r\n\r\n",
    "chunk too long": CHUNKED + b"\r\n5\r\nhello!\r\n0\r\n\r\n",
    "chunk size huge": CHUNKED + b"\r\n" + b"f" * 20 + b"\r\nhello\r\n0\r\n\r\n",
    "chunk with bare newlines": CHUNKED + b"\r\n5\nhello\n0\n\n",
    "chunk without its end": CHUNKED + b"\r\n5\r\nhello0\r\n\r\n",
    "trailer": CHUNKED + b"\r\n5\r\nhello\r\n0\r\nX-Late: 1\r\n\r\n",
    "trailer with a key": CHUNKED + b"\r\n0\r\nAuthorization: Bearer sk_x\r\n\r\n",
    "trailer with an address": CHUNKED + b"\r\n0\r\nX-Forwarded-For: 9.9.9.9\r\n\r\n",
    "trailer with a cookie": CHUNKED + b"\r\n0\r\nCookie: skyway_session=x\r\n\r\n",
    "trailer with a length": CHUNKED + b"\r\n5\r\nhello\r\n0\r\nContent-Length: 3\r\n\r\n",
    "trailer with an encoding": CHUNKED + b"\r\n0\r\nTransfer-Encoding: gzip\r\n\r\n",
    "trailers, then a request": CHUNKED + b"\r\n0\r\nX-A: 1\r\nX-B: 2\r\n\r\n" + GET + b"\r\n",
    "gzip, chunked": POST + b"Transfer-Encoding: gzip, chunked\r\n\r\n0\r\n\r\n",
    "chunked, gzip": POST + b"Transfer-Encoding: chunked, gzip\r\n\r\n0\r\n\r\n",
    "chunked twice": CHUNKED + b"Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
    "chunked, chunked": POST + b"Transfer-Encoding: chunked, chunked\r\n\r\n0\r\n\r\n",
    "identity": POST + b"Transfer-Encoding: identity\r\n\r\n",
    "xchunked": POST + b"Transfer-Encoding: xchunked\r\n\r\n0\r\n\r\n",
    "chunked in capitals": POST + b"Transfer-Encoding: CHUNKED\r\n\r\n0\r\n\r\n",
    "chunked after a tab": POST + b"Transfer-Encoding:\tchunked\r\n\r\n0\r\n\r\n",
    "chunked after a form feed": POST + b"Transfer-Encoding:\x0cchunked\r\n\r\n0\r\n\r\n",
    "encoding with a space before the colon": POST + b"Transfer-Encoding : chunked\r\n\r\n",
    "chunks in HTTP/1.0": b"POST / HTTP/1.0\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
    "folded header": GET + b"X-A: 1\r\n 2\r\n\r\n",
    "folded with tab": GET + b"X-A: 1\r\n\t2\r\n\r\n",
    "folded first header": b"GET / HTTP/1.1\r\n Host: x\r\n\r\n",
    "folded length": POST + b"Content-Length: 5\r\n 5\r\n\r\nhello",
    "bare newlines": b"GET / HTTP/1.1\nHost: x\n\n",
    "bare newline in the head": GET + b"X-A: 1\nX-B: 2\r\n\r\n",
    "bare newline at the end": GET + b"X-A: 1\r\n\n",
    "bare return": GET + b"X-A: 1\rX-B: 2\r\n\r\n",
    "newlines first": b"\r\n\r\n" + GET + b"\r\n",
    "a bare newline first": b"\n" + GET + b"\r\n",
    "zero byte in a value": GET + b"X-A: a\x00b\r\n\r\n",
    "zero byte in a name": GET + b"X-\x00A: a\r\n\r\n",
    "high bytes in a value": GET + b"X-A: \xc3\xa4\xff\r\n\r\n",
    "high bytes in a name": GET + b"X-\xc3: a\r\n\r\n",
    "control byte in a value": GET + b"X-A: a\x01b\r\n\r\n",
    "delete in a value": GET + b"X-A: a\x7fb\r\n\r\n",
    "no colon": GET + b"X-A\r\n\r\n",
    "no name": GET + b": a\r\n\r\n",
    "no value": GET + b"X-A:\r\n\r\n",
    "space in a name": GET + b"X A: a\r\n\r\n",
    "space before the colon": GET + b"X-A : a\r\n\r\n",
    "spaces around a value": GET + b"X-A: \t a \t \r\n\r\n",
    "parenthesis in a name": GET + b"X(A): a\r\n\r\n",
    "the same header twice": GET + b"X-A: 1\r\nX-A: 2\r\n\r\n",
    "host missing": b"GET / HTTP/1.1\r\n\r\n",
    "host twice": GET + b"Host: y\r\n\r\n",
    "host empty": b"GET / HTTP/1.1\r\nHost:\r\n\r\n",
    "whole URL": b"GET http://y/a?b HTTP/1.1\r\nHost: x\r\n\r\n",
    "asterisk": b"OPTIONS * HTTP/1.1\r\nHost: x\r\n\r\n",
    "connect": b"CONNECT x:80 HTTP/1.1\r\nHost: x\r\n\r\n",
    "no slash": b"GET a HTTP/1.1\r\nHost: x\r\n\r\n",
    "space in the target": b"GET /a b HTTP/1.1\r\nHost: x\r\n\r\n",
    "tab in the target": b"GET /a\tb HTTP/1.1\r\nHost: x\r\n\r\n",
    "zero byte in the target": b"GET /a\x00b HTTP/1.1\r\nHost: x\r\n\r\n",
    "high bytes in the target": b"GET /\xc3\xa4 HTTP/1.1\r\nHost: x\r\n\r\n",
    "fragment in the target": b"GET /a#b HTTP/1.1\r\nHost: x\r\n\r\n",
    "two slashes": b"GET //y/a HTTP/1.1\r\nHost: x\r\n\r\n",
    "two spaces before the target": b"GET  / HTTP/1.1\r\nHost: x\r\n\r\n",
    "two spaces after the target": b"GET /  HTTP/1.1\r\nHost: x\r\n\r\n",
    "space at the end of the line": b"GET / HTTP/1.1 \r\nHost: x\r\n\r\n",
    "no version": b"GET /\r\n\r\n",
    "HTTP/0.9": b"GET / HTTP/0.9\r\n\r\n",
    "HTTP/1.0": b"GET / HTTP/1.0\r\n\r\n",
    "HTTP/1.2": b"GET / HTTP/1.2\r\nHost: x\r\n\r\n",
    "HTTP/2.0": b"GET / HTTP/2.0\r\nHost: x\r\n\r\n",
    "http in lower case": b"GET / http/1.1\r\nHost: x\r\n\r\n",
    "preface of HTTP/2": b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    "unknown method": b"BREW / HTTP/1.1\r\nHost: x\r\n\r\n",
    "method in lower case": b"get / HTTP/1.1\r\nHost: x\r\n\r\n",
    "SOURCE of icecast": b"SOURCE / ICE/1.0\r\nHost: x\r\n\r\n",
    "RTSP": b"OPTIONS / RTSP/1.0\r\n\r\n",
    "upgrade": GET + b"Connection: Upgrade\r\nUpgrade: websocket\r\n\r\n",
    "upgrade to h2c": GET + b"Connection: Upgrade\r\nUpgrade: h2c\r\nHTTP2-Settings: x\r\n\r\n",
    "upgrade with a body": POST
    + b"Connection: Upgrade\r\nUpgrade: websocket\r\nContent-Length: 5\r\n\r\nhello",
    "upgrade with chunks": CHUNKED
    + b"Connection: Upgrade\r\nUpgrade: websocket\r\n\r\n5\r\nhello\r\n0\r\n\r\n",
    "upgrade, then a request": GET
    + b"Connection: Upgrade\r\nUpgrade: websocket\r\n\r\n"
    + GET
    + b"X-Second: 1\r\n\r\n",
    "two requests": GET + b"\r\n" + POST + b"Content-Length: 2\r\n\r\nhi",
    "a second request with two spaces": GET + b"\r\nGET  / HTTP/1.1\r\nHost: x\r\n\r\n",
    "a second request without a version": GET + b"\r\nGET /\r\nHost: x\r\n\r\n",
    "a second request of icecast": GET + b"\r\nSOURCE / ICE/1.0\r\nHost: x\r\n\r\n",
    "a second request after a bare newline": GET + b"\r\n\n" + GET + b"\r\n",
    "a bad request after a body": POST + b"Content-Length: 2\r\n\r\nhiGET  / HTTP/1.1\r\n\r\n",
    "a bad request after chunks": CHUNKED + b"\r\n0\r\n\r\nGET /\r\nHost: x\r\n\r\n",
    "close, then a request": GET + b"Connection: close\r\n\r\n" + GET + b"X-Second: 1\r\n\r\n",
    "expectation": POST + b"Expect: 100-continue\r\nContent-Length: 5\r\n\r\nhello",
}

#: Method, target, headers and body of each request.
Understood = list[tuple[bytes, bytes, list[tuple[bytes, bytes]], bytes]]
seen: Understood = []


async def app(scope: Scope, receive: Receive, send: Send) -> None:
    """Note each request that has come as a whole, and answer it."""
    body, has_more = b"", True
    while has_more:
        message = await receive()
        if message["type"] == "http.disconnect":
            return
        body += message.get("body", b"")
        has_more = message.get("more_body", False)
    query = b"?" + scope["query_string"] if scope["query_string"] else b""
    # h11 writes this value in lower case.
    headers = [
        (name, value.lower() if name == b"transfer-encoding" else value)
        for name, value in scope["headers"]
    ]
    seen.append((scope["method"].encode(), scope["raw_path"] + query, headers, body))
    await send({"type": "http.response.start", "status": 204, "headers": []})
    await send({"type": "http.response.body"})


def understood_by_h11(raw: bytes) -> Understood:
    """The requests in these bytes, up to the first that h11 refuses."""
    connection = h11.Connection(h11.SERVER, max_incomplete_event_size=10_000)
    found: Understood = []
    connection.receive_data(raw)
    connection.receive_data(b"")
    request, body = h11.Request(method="GET", target="/", headers=[("Host", "x")]), b""
    try:
        while True:
            event = connection.next_event()
            if isinstance(event, h11.Request):
                request, body = event, b""
            elif isinstance(event, h11.Data):
                body += event.data
            elif isinstance(event, h11.EndOfMessage):
                path, _, query = request.target.partition(b"?")
                target = request.target if query else path
                found.append((request.method, target, [*request.headers], body))
                connection.send(h11.Response(status_code=400, headers=[]))
                connection.send(h11.EndOfMessage())
                if connection.our_state is not h11.DONE:
                    return found
                connection.start_next_cycle()
            else:
                return found
    except (h11.RemoteProtocolError, h11.LocalProtocolError):  # the second: of its own answer
        return found


@pytest.fixture
async def front() -> AsyncIterator[Front]:
    made = Front(LIMITS, app)
    server = await made.start()
    yield made
    await server.shutdown()


async def understood_by_front(front: Front, *parts: bytes) -> Understood:
    seen.clear()
    reader, writer = await front.connect()
    try:
        for part in parts:
            writer.write(part)
            await writer.drain()
        writer.write_eof()
        await reader.read()
    except ConnectionError:
        pass
    finally:
        writer.close()
    return seen.copy()


async def test_what_the_front_accepts_it_understands_as_h11_does(
    front: Front, subtests: pytest.Subtests
) -> None:
    for form, raw in FORMS.items():
        expected = understood_by_h11(raw)
        for cut in (len(raw), len(raw) // 2, len(raw) - 3):
            with subtests.test(form, cut=cut):
                found = await understood_by_front(front, raw[:cut], raw[cut:])
                assert found == expected[: len(found)]


#: What is put into requests at random places.
PIECES: Final = (
    *(
        b"\r\n",
        b"\n",
        b"\r",
        b" ",
        b"\t",
        b"\x00",
        b"\x80",
        b":",
        b";",
        b",",
        b"#",
        b"?",
        b"+",
        b"-",
    ),
    *(
        b"0",
        b"5",
        b"hello",
        b"0\r\n\r\n",
        b"HTTP/1.0",
        b"HTTP/1.1",
        b"http://",
        b"HEAD ",
        b"CONNECT ",
    ),
    *(b"chunked", b"Transfer-Encoding: ", b"Content-Length: ", b"Host: y\r\n", b"X: \r\n y\r\n"),
    *(b"Connection: close\r\n", b"Upgrade: h2c\r\n", b"Expect: 100-continue\r\n", GET + b"\r\n"),
)


def changed(raw: bytes, chance: Random) -> bytes:
    """The request with pieces put in, cut out or repeated at random places."""
    for _ in range(chance.randint(1, 3)):
        begin, end = sorted(chance.randint(0, len(raw)) for _ in range(2))
        match chance.choice(("put in", "cut out", "repeat")):
            case "put in":
                raw = raw[:begin] + chance.choice(PIECES) + raw[begin:]
            case "cut out":
                raw = raw[:begin] + raw[begin + chance.randint(1, 4) :]
            case _:
                raw = raw[:end] + raw[begin:]
    return raw[: LIMITS.head_bytes]


@pytest.mark.long
async def test_changed_at_random_a_request_is_understood_as_by_h11_or_refused(
    front: Front, subtests: pytest.Subtests
) -> None:
    chance, forms = Random(1), [*FORMS.values()]
    for _ in range(1_500):
        raw = changed(b"".join(chance.sample(forms, chance.choice((1, 1, 2)))), chance)
        cut = chance.randint(0, len(raw))
        found = await understood_by_front(front, raw[:cut], raw[cut:])
        expected = understood_by_h11(raw)
        if found != expected[: len(found)]:
            with subtests.test(raw=raw, cut=cut):
                assert found == expected[: len(found)]
