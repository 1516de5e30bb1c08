"""Callers who do the dearest things that their budgets allow, in a process of their own.

`python -m skyway_lab.hostile.attackers`, with an `Attack` as JSON on the standard input. It ends
when its input ends, and prints how often each thing was answered in which way.
"""

import asyncio
import json
import os
import random
import sys
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from typing import Final
from urllib.parse import urlsplit

import uvloop
from pydantic import TypeAdapter
from pydantic.dataclasses import dataclass

#: Connections of each attacker.
_TOGETHER: Final = 3
#: Wall seconds that an attacker waits after a connection was refused.
_PAUSE_S: Final = 0.1
_ANSWERED_WITHIN_S: Final = 30.0


@dataclass(frozen=True)
class Call:
    """One call; a `stream` is left once its first bytes have come."""

    name: str
    method: str
    path: str
    headers: dict[str, str]
    body: str = ""
    stream: bool = False


@dataclass(frozen=True)
class Attacker:
    """Somebody who calls from one address, in a random order."""

    address: str
    calls: list[Call]


@dataclass(frozen=True)
class Attack:
    """All who attack at the same time."""

    url: str
    seed: int
    attackers: list[Attacker]


async def _attack(attack: Attack) -> Counter[str]:
    found: Counter[str] = Counter()
    reading = asyncio.to_thread(sys.stdin.read)
    tasks = [
        asyncio.create_task(
            _call_on(attack.url, each, random.Random(f"{attack.seed}{n}{k}"), found)
        )
        for n, each in enumerate(attack.attackers)
        for k in range(_TOGETHER)
    ]
    await reading
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    return found


async def _call_on(
    url: str, attacker: Attacker, chance: random.Random, found: Counter[str]
) -> None:
    """Call for ever, over one connection as long as it lasts."""
    parts = urlsplit(url)
    while True:
        with suppress(OSError, asyncio.IncompleteReadError, TimeoutError):
            reader, writer = await asyncio.open_connection(
                parts.hostname, parts.port, local_addr=(attacker.address, 0)
            )
            try:
                await _call_over(reader, writer, attacker.calls, chance, found)
            finally:
                writer.close()
        found["connections ended"] += 1
        await asyncio.sleep(_PAUSE_S)


async def _call_over(
    reader: asyncio.StreamReader,
    writer: asyncio.StreamWriter,
    calls: Sequence[Call],
    chance: random.Random,
    found: Counter[str],
) -> None:
    while True:
        call = chance.choice(calls)
        writer.write(_encoded(call))
        async with asyncio.timeout(_ANSWERED_WITHIN_S):
            head = await reader.readuntil(b"\r\n\r\n")
            status = head.split(b" ", 2)[1].decode()
            found[f"{call.name}: {status}"] += 1
            lines = head.lower().split(b"\r\n")
            lengths = [line[15:] for line in lines if line.startswith(b"content-length:")]
            if not lengths:
                await reader.read(100)
                return
            await reader.readexactly(int(lengths[0]))


def _encoded(call: Call) -> bytes:
    body = call.body.encode()
    headers = {"Host": "attacked", **call.headers}
    if body:
        headers |= {"Content-Type": "application/json", "Content-Length": str(len(body))}
    lines = [f"{call.method} {call.path} HTTP/1.1", *(f"{n}: {v}" for n, v in headers.items())]
    return "\r\n".join([*lines, "", ""]).encode() + body


if __name__ == "__main__":
    # Attackers have machines of their own; here they share the processors with the system.
    os.nice(5)
    read = TypeAdapter(Attack).validate_json(sys.stdin.readline())
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        print(json.dumps(runner.run(_attack(read))), flush=True)
