"""Starts viewers of the live picture beside a fleet, and puts into a table what they saw."""

import asyncio
import json
import sys
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any, Final

from skyway_lab.benchmarks.planner.table import Table

from skyway.cli.gateway import GatewayApi

#: Viewers of one operator's key; a tenant may have 200 streams open.
_PER_KEY: Final = 100


@dataclass(slots=True)
class Viewing:
    """Viewers in a process of their own; `seen` is there once the block was left."""

    viewers: int
    seconds: float
    seen: Mapping[str, Any]

    def table(self) -> Table:
        """How old readings were when viewers had them, and how much they received."""
        ages_s = sorted(self.seen["ages_s"])
        snapshots, ended = self.seen["snapshots"], self.seen["ended"]
        rate = self.seen["received_bytes"] / self.seconds / max(1, self.viewers) / 1024
        return Table(
            "fleet-viewing",
            f"{self.viewers} viewers of all that flies.",
            ("from a drone's reading to a viewer", "p50", "p99", "seen"),
            [("position", _at(ages_s, 0.5), _at(ages_s, 0.99), f"{len(ages_s):,}")],
            [
                f"{rate:.1f} KiB/s for each viewer.",
                f"Viewers with a snapshot: {snapshots}; put out: {ended}.",
            ],
        )


@asynccontextmanager
async def viewing(
    url: str, operator_key: str, *, viewers: int, seconds: float
) -> AsyncIterator[Viewing]:
    """Viewers who look while the block lasts; it begins when all have their snapshots."""
    keys = await _operators(url, operator_key, count=-(-viewers // _PER_KEY))
    process = await asyncio.create_subprocess_exec(
        *(
            sys.executable,
            "-m",
            "skyway_lab.benchmarks.fleet.viewers",
            url,
            str(viewers),
            str(seconds),
        ),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        limit=2**26,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdin.write("\n".join(keys).encode())
    process.stdin.close()
    await process.stderr.readline()
    found = Viewing(viewers, seconds, {})
    yield found
    found.seen = json.loads(await process.stdout.read())
    await process.wait()


async def _operators(url: str, operator_key: str, *, count: int) -> list[str]:
    """New keys of operators of their own."""
    keys = []
    async with GatewayApi(url) as api:
        for number in range(count):
            body = {"role": "operator", "subject_id": f"viewer-{number}"}
            issued = await api.call("POST", "/v1/keys", key=operator_key, body=body)
            keys.append(issued["key"])
    return keys


def _at(ordered: list[float], share: float) -> str:
    if not ordered:
        return "never"
    return f"{ordered[min(len(ordered) - 1, int(len(ordered) * share))]:.2f} s"
