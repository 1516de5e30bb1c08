"""Many viewers of the live picture, in a process of their own.

`python -m skyway_lab.fleet.viewers URL COUNT SECONDS` reads operators' keys from stdin, one a line,
and prints what the viewers saw as JSON. All viewers receive all changes. One in fifty also reads
them: it notes how old each drone's reading is when it comes.
"""

import asyncio
import contextlib
import json
import sys
import time
from collections.abc import AsyncIterator, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from typing import Any, Final

import aiohttp

#: One in so many viewers reads what comes.
_READING: Final = 50
#: A gateway takes so many connections of one address; viewers come from several.
_PER_ADDRESS: Final = 100
#: Wall seconds until all viewers have their snapshots.
_ALL_BY_S: Final = 20.0
#: Wall seconds after the last snapshot: what waited behind the snapshots of all is not steady.
_SETTLE_S: Final = 3.0
_CHUNK_BYTES: Final = 64 * 1024


@dataclass(slots=True)
class Seen:
    """What all viewers have seen in the window."""

    ages_s: list[float] = field(default_factory=list)
    received_bytes: int = 0
    snapshots: int = 0
    ended: int = 0
    #: From when on bytes and ages count, monotonic seconds.
    since_s: float = float("inf")

    @property
    def counts(self) -> bool:
        """Whether the window has begun."""
        return time.monotonic() >= self.since_s


async def watch(url: str, keys: Sequence[str], *, count: int, seconds: float) -> Seen:
    """Open all streams, and look at what comes in a window of seconds."""
    seen = Seen()
    looking = [asyncio.Event() for _ in range(count)]
    viewers = [
        asyncio.create_task(_view(url, keys[number % len(keys)], number, seen, looking[number]))
        for number in range(count)
    ]
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(_ALL_BY_S):
            for each in looking:
                await each.wait()
    await asyncio.sleep(_SETTLE_S)
    seen.since_s = time.monotonic()
    print("all look", file=sys.stderr, flush=True)
    await asyncio.sleep(seconds)
    for viewer in viewers:
        viewer.cancel()
    await asyncio.gather(*viewers, return_exceptions=True)
    return seen


async def _view(url: str, key: str, number: int, seen: Seen, looks: asyncio.Event) -> None:
    address = (f"127.0.1.{1 + number // _PER_ADDRESS}", 0)
    connector = aiohttp.TCPConnector(local_addr=address)
    timeout = aiohttp.ClientTimeout(total=None)
    headers = {"Authorization": f"Bearer {key}"}
    async with (
        aiohttp.ClientSession(connector=connector, timeout=timeout) as client,
        client.get(f"{url}/v1/live", headers=headers) as answer,
    ):
        answer.raise_for_status()
        is_reading = number % _READING == 0
        async for event in _events(answer, seen):
            if b"event: snapshot" in event:
                seen.snapshots += 1
                looks.set()
            elif is_reading and seen.counts:
                seen.ages_s += _ages(event)
    seen.ended += 1


async def _events(answer: aiohttp.ClientResponse, seen: Seen) -> AsyncIterator[bytes]:
    rest = b""
    async for chunk in answer.content.iter_chunked(_CHUNK_BYTES):
        if seen.counts:
            seen.received_bytes += len(chunk)
        *events, rest = (rest + chunk).split(b"\n\n")
        for event in events:
            yield event


def _ages(event: bytes) -> list[float]:
    """How old the readings of drones in this change are, wall seconds at a clock rate of 1."""
    now = datetime.now(UTC)
    data: Any = json.loads(event.partition(b"data: ")[2] or b"{}")
    return [
        (now - datetime.fromisoformat(drone["at"])).total_seconds()
        for drone in data.get("drones", {}).values()
        if drone is not None and "at" in drone
    ]


def main(arguments: list[str]) -> int:
    """Watch and print."""
    url, count, seconds = arguments
    keys = sys.stdin.read().split()
    seen = asyncio.run(watch(url, keys, count=int(count), seconds=float(seconds)))
    with contextlib.suppress(BrokenPipeError):
        print(json.dumps(asdict(seen) | {"since_s": None}))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
