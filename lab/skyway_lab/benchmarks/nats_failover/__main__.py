"""Kills a node of three of NATS while instructions are under way, and closes accounts.

`python -m skyway_lab nats_failover --drones 1000 --runs 20` prints a row for each run: what was
lost, and how long clients and instructions paused. Before the kill, the accounts of some drones are
closed at all nodes, and opened again. With `--deliveries`, a whole Skyway with this many drones
flies this many deliveries. The program ends with 1 if anything was lost or a closed account got in.
"""

import argparse
import asyncio
import logging
import random
import signal
import sys
import tempfile
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from skyway_lab.benchmarks.nats_failover.cluster import NODES, Cluster
from skyway_lab.benchmarks.nats_failover.flown import fly
from skyway_lab.benchmarks.nats_failover.light_drones import (
    AGAIN_AFTER_S,
    PROVIDER,
    SENDER,
    Drone,
    Sender,
    connected,
)
from skyway_lab.benchmarks.planner.machine import Machine
from skyway_lab.benchmarks.planner.table import Table

from skyway.broker_setup.nats_accounts import hash_for_nats, nats_accounts
from skyway.broker_setup.private_file import write_private
from skyway.contracts.broker_rules import BrokerRules

#: Wall seconds of instructions before the kill, after it, and of waiting for the last answers.
_BEFORE_S, _AFTER_S, _LAST_ANSWERS_S = 5.0, 20.0, 60.0
#: Every so many-th drone has its account closed.
_CLOSED: Final = 10

_HEADER: Final = (
    *("seed", "node", "instructions", "lost", "repeated, done once"),
    *("slowest before", "slowest after", "longest pause of a drone", "closed accounts out after"),
)
_FLOWN_HEADER: Final = (
    *("seed", "node", "became", "nothing accepted for", "all connected after", "verify"),
)


@dataclass(frozen=True, slots=True)
class Accounts:
    """The file of accounts of light drones and of their sender."""

    file: Path
    hashes: Mapping[str, str]

    def close(self, closed: Iterable[str]) -> None:
        """Refuse these accounts, and let all others in again."""
        names = self.hashes.keys() - set(closed)
        hashes = {name: self.hashes[name] for name in sorted(names)}
        write_private(self.file, nats_accounts(hashes, BrokerRules()))


async def run(given: argparse.Namespace, *, seed: int) -> tuple[bool, tuple[str, ...]]:
    """One run with light drones: whether nothing was lost, and the row of the table."""
    killed = seed % NODES
    names = [f"{PROVIDER}/drone-{number}" for number in range(given.drones)]
    with tempfile.TemporaryDirectory(prefix="skyway-nats-") as name:
        folder = Path(name)
        hashes = {each: hash_for_nats(each) for each in (SENDER, *names)}
        accounts = Accounts(folder / "accounts.conf", hashes)
        accounts.close(())
        cluster = Cluster(folder, accounts=accounts.file)
        try:
            cluster.start()
            async with connected(cluster.url, names) as (sender, drones):
                closed_s, is_closed = await _close_some(accounts, drones)
                chance = random.Random(seed)
                unanswered = await _instruct(
                    cluster, sender, drones, killed=killed, per_s=given.per_s, chance=chance
                )
                slowest = _slowest(sender)
                sent = len(sender.sent_at)
        finally:
            cluster.stop()
    repeated = sum(each.received - len(each.done) for each in drones)
    pause_s = max(each.longest_pause_s for each in drones)
    counts = (sent, unanswered, repeated)
    row = (
        *map(str, (seed, killed, *counts)),
        *(f"{each:.1f} s" for each in (*slowest, pause_s)),
        f"{closed_s:.2f} s" if is_closed else "NOT ALL",
    )
    return not unanswered and is_closed, row


async def _close_some(accounts: Accounts, drones: Sequence[Drone]) -> tuple[float, bool]:
    """After how many seconds closed accounts were out at every node, and whether they stayed out.

    Returns once their accounts are open again, and they are connected.
    """
    closed, others = drones[::_CLOSED], [each for n, each in enumerate(drones) if n % _CLOSED]
    at_s = time.monotonic()
    accounts.close(f"{PROVIDER}/{each.name}" for each in closed)
    is_out = False
    with suppress(TimeoutError):
        async with asyncio.timeout(30.0):
            for each in closed:
                await each.client.wait_lost()
            is_out = True
    closed_s = time.monotonic() - at_s
    await asyncio.sleep(AGAIN_AFTER_S)
    stayed_out = not any(each.client.is_connected for each in closed)
    stayed_in = all(each.client.is_connected for each in others)
    accounts.close(())
    async with asyncio.timeout(60.0):
        for each in drones:
            await each.client.wait_connected()
    for each in drones:
        each.longest_pause_s = 0.0
    return closed_s, is_out and stayed_out and stayed_in


async def _instruct(
    cluster: Cluster,
    sender: Sender,
    drones: Sequence[Drone],
    *,
    killed: int,
    per_s: float,
    chance: random.Random,
) -> int:
    """Send instructions to drones in turn and kill a node meanwhile; how many had no answer."""
    order = chance.sample(range(len(drones)), len(drones))
    before, after = round(_BEFORE_S * per_s), round(_AFTER_S * per_s)
    sending = []
    started_s = time.monotonic()
    for number in range(before + after):
        if number == before:
            await asyncio.to_thread(cluster.kill, killed)
        drone = drones[order[number % len(order)]]
        seq = 1 + number // len(order)
        sending.append(asyncio.create_task(sender.send(drone.name, seq)))
        if number < before:
            sender.sent_before.add((drone.name, seq))
        await asyncio.sleep(max(0.0, started_s + (number + 1) / per_s - time.monotonic()))
    _, unanswered = await asyncio.wait(sending, timeout=_LAST_ANSWERS_S)
    for task in unanswered:
        task.cancel()
    return len(unanswered)


def _slowest(sender: Sender) -> tuple[float, float]:
    """The longest time to an answer, of the instructions before the kill and of all others."""
    before = [took for each, took in sender.answered_s.items() if each in sender.sent_before]
    after = [took for each, took in sender.answered_s.items() if each not in sender.sent_before]
    return max(before, default=0.0), max(after, default=0.0)


async def _fly(given: argparse.Namespace, *, seed: int) -> tuple[bool, tuple[str, ...]]:
    killed = seed % NODES
    flown = await fly(drones=given.drones, deliveries=given.deliveries, seed=seed, killed=killed)
    return flown.is_right, flown.row(seed, killed)


def main() -> int:
    """Run as often as asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drones", type=int, default=300)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--per-s", type=float, default=60.0, help="instructions of light drones")
    parser.add_argument("--deliveries", type=int, default=0, help="fly these; 0: light drones")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    # Ended by a signal, the nodes end too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    # Each client would log its lost connection.
    logging.getLogger("skyway.runtime.mqtt").setLevel(logging.ERROR)
    print(f"{Machine.here().as_text()}; {given.drones} drones on {NODES} nodes\n", flush=True)
    one_run = _fly if given.deliveries else run
    rows, right = [], 0
    for seed in range(given.seed, given.seed + given.runs):
        is_right, row = asyncio.run(one_run(given, seed=seed))
        rows.append(row)
        right += is_right
        print(" | ".join(row), flush=True)
    caption = f"A node of NATS was killed: {right} of {given.runs} runs without a loss."
    header = _FLOWN_HEADER if given.deliveries else _HEADER
    print(Table("nats-failover", caption, header, rows).as_markdown(), flush=True)
    return 0 if right == given.runs else 1


if __name__ == "__main__":
    sys.exit(main())
