"""A customer's server that receives webhooks."""

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator
from typing import Any


class Receiver:
    """A customer's HTTP server on loopback; answers with the next of `answers`, then 204."""

    def __init__(self) -> None:
        self.answers: list[int | str] = []
        self.retry_after: str | None = None
        self.received: list[tuple[dict[str, str], dict[str, Any]]] = []
        self.bodies: list[bytes] = []
        self.has_received = asyncio.Event()
        self.port = 0
        self.hangs = asyncio.Event()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/in"

    @property
    def types(self) -> list[str]:
        return [event["type"] for _, event in self.received]

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError, asyncio.IncompleteReadError):
            head = (await reader.readuntil(b"\r\n\r\n")).decode().split("\r\n")
            lines = (line.partition(": ") for line in head[1:] if line)
            headers = {name.lower(): value for name, _, value in lines}
            body = await reader.readexactly(int(headers["content-length"]))
            self.received.append((headers, json.loads(body)))
            self.bodies.append(body)
            self.has_received.set()
            answer = self.answers.pop(0) if self.answers else 204
            if answer == "hang":
                await self.hangs.wait()
            elif answer != "drop":
                location = f"Location: {self.url}/elsewhere\r\n" if answer == 302 else ""
                if self.retry_after is not None:
                    location += f"Retry-After: {self.retry_after}\r\n"
                text = f"HTTP/1.1 {answer} X\r\n{location}Content-Length: 0\r\n\r\n"
                writer.write(text.encode())
                await writer.drain()
        writer.close()


@contextlib.asynccontextmanager
async def receiving() -> AsyncIterator[Receiver]:
    receiver = Receiver()
    server = await asyncio.start_server(receiver.serve, "127.0.0.1", 0)
    receiver.port = server.sockets[0].getsockname()[1]
    async with server:
        yield receiver
        receiver.hangs.set()
