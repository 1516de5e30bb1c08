"""A wire between two processes: a proxy that can be cut, silenced and slowed."""

import asyncio
from contextlib import suppress
from pathlib import Path
from typing import Self

#: A TCP address, or a socket in the file system.
Endpoint = tuple[str, int] | Path

_CHUNK_BYTES = 65_536


class Wire:
    """Listens and forwards everything in both directions; other processes connect to it.

    Parameters
    ----------
    listens_at
        A socket in the file system; without it a free port of 127.0.0.1.
    """

    def __init__(self, name: str, target: Endpoint, *, listens_at: Path | None = None) -> None:
        self.name = name
        self._target = target
        self._listens_at = listens_at
        self._server: asyncio.Server | None = None
        self._is_cut = False
        self._carries = asyncio.Event()
        self._carries.set()
        self._delay_s = 0.0
        self._writers: set[asyncio.StreamWriter] = set()
        self._serving: set[asyncio.Task[None]] = set()

    async def __aenter__(self) -> Self:
        if self._listens_at is not None:
            self._server = await asyncio.start_unix_server(self._serve, self._listens_at)
            self._listens_at.chmod(0o600)
        else:
            self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._server is not None:
            self._server.close()
        self.cut()
        self._carries.set()
        await asyncio.gather(*self._serving)

    @property
    def port(self) -> int:
        """The port at which it listens."""
        if self._server is None:
            raise RuntimeError(f"the wire {self.name} is not open")
        port: int = self._server.sockets[0].getsockname()[1]
        return port

    @property
    def folder(self) -> Path | None:
        """The folder of the socket at which it listens; None when it listens at a port."""
        return None if self._listens_at is None else self._listens_at.parent

    def cut(self) -> None:
        """Break all connections and refuse new ones."""
        self._is_cut = True
        for writer in list(self._writers):
            writer.transport.abort()

    def silence(self) -> None:
        """Hold all bytes back, in both directions; connections stay open."""
        self._carries.clear()

    def slow(self, delay_s: float) -> None:
        """Let every piece of data arrive so much later."""
        self._delay_s = delay_s

    def heal(self) -> None:
        """Forward everything again, what was held back first."""
        self._is_cut = False
        self._delay_s = 0.0
        self._carries.set()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        serving = asyncio.current_task()
        if serving is not None:
            self._serving.add(serving)
            serving.add_done_callback(self._serving.discard)
        with suppress(OSError):
            await self._carries.wait()
            if not self._is_cut:
                await self._join(reader, writer)
        await _ended(writer)

    async def _join(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        far_reader, far_writer = await self._connect()
        self._writers |= {writer, far_writer}
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self._forward(reader, far_writer))
                group.create_task(self._forward(far_reader, writer))
        finally:
            self._writers -= {writer, far_writer}
            await _ended(far_writer)

    async def _connect(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        if isinstance(self._target, Path):
            return await asyncio.open_unix_connection(self._target)
        return await asyncio.open_connection(*self._target)

    async def _forward(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Forward until the sender closes; the other direction then ends too."""
        with suppress(OSError):
            while data := await reader.read(_CHUNK_BYTES):
                if self._delay_s:
                    await asyncio.sleep(self._delay_s)
                await self._carries.wait()
                if writer.is_closing():
                    return
                writer.write(data)
                await writer.drain()
        with suppress(OSError):
            writer.close()
            await writer.wait_closed()


async def _ended(writer: asyncio.StreamWriter) -> None:
    writer.transport.abort()
    with suppress(OSError):
        await writer.wait_closed()
