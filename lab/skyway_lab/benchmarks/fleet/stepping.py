"""The embedded broker's limit: at how many messages a second its deliveries come too late."""

import asyncio
import contextlib
import itertools
import math
import os
import tempfile
import time
from collections.abc import Sequence
from contextlib import AbstractAsyncContextManager, AsyncExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone
from skyway_lab.benchmarks.fleet.crew import accounts_of, crew_of
from skyway_lab.benchmarks.fleet.drone_messages import DroneMessages, receiving
from skyway_lab.benchmarks.fleet.lines import Lines
from skyway_lab.benchmarks.fleet.own_broker import own_embedded
from skyway_lab.benchmarks.fleet.plain_sender import PlainSender, plain_sender
from skyway_lab.benchmarks.load.cpu import CpuReading
from skyway_lab.benchmarks.planner.table import Table

#: A delivery that comes later than this has the broker beyond its limit, seconds.
LIMIT_S: Final = 1.0

#: Messages a second of the first step, and how much more each further step has.
_FIRST_PER_S, _GROWTH, _MOST_PER_S = 100.0, 1.35, 20_000.0

#: One in so many messages is a state, mqtt_qos 1 and retained; the others are samples.
_STATE_EVERY: Final = 4

#: Drones that send.
_SENDERS: Final = 100

#: Wall seconds between two handfuls of messages.
_BEAT_S: Final = 0.02
#: Wall seconds for the last message of a rate to arrive.
_LAST_WITHIN_S: Final = 5.0


@dataclass(frozen=True, slots=True)
class Step:
    """One rate, how late its messages were, and who worked how much for them."""

    sent_per_s: float
    received_per_s: float
    late_p50_s: float
    late_p99_s: float
    broker_cores: float
    own_cores: float


async def step_up(*, seed: int, seconds: float) -> Table:
    """Send faster and faster, `seconds` at each rate, until deliveries come too late."""
    crew = crew_of(_SENDERS, seed=seed)
    async with AsyncExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="skyway-fleet-"))
        broker = stack.enter_context(own_embedded(Path(folder), accounts_of(crew)))
        messages = await stack.enter_async_context(receiving(broker.services_url))
        senders = [
            await stack.enter_async_context(_connected(broker.drones_url, drone)) for drone in crew
        ]
        return _table(await _steps(_Chorus(crew, senders), messages, broker.pid, seconds))


async def _steps(
    chorus: "_Chorus", messages: DroneMessages, pid: int, seconds: float
) -> list[Step]:
    steps: list[Step] = []
    per_s = _FIRST_PER_S
    while per_s <= _MOST_PER_S:
        step = await _step(chorus, messages, per_s=per_s, pid=pid, seconds=seconds)
        steps.append(step)
        if step.late_p99_s > LIMIT_S:
            break
        per_s *= _GROWTH
    return steps


class _Chorus:
    """Sends what drones in flight send, drone after drone."""

    def __init__(self, crew: Sequence[EnrolledDrone], senders: Sequence[PlainSender]) -> None:
        self._turns = itertools.cycle(zip(map(Lines.of, crew), senders, strict=True))
        self._numbers = itertools.count(1)

    async def send(self, per_s: float, *, seconds: float) -> int:
        """Send at this rate for so long; how many messages it were."""
        loop = asyncio.get_running_loop()
        began_s, sent = loop.time(), 0
        while (passed_s := loop.time() - began_s) < seconds:
            while sent < per_s * passed_s:
                self._send_one()
                sent += 1
            await asyncio.sleep(_BEAT_S)
        return sent

    def _send_one(self) -> None:
        lines, sender = next(self._turns)
        if next(self._numbers) % _STATE_EVERY == 0:
            sender.send_retained(lines.state_topic, lines.state.now())
        else:
            sender.send(lines.telemetry_topic, lines.sample.now())


async def _step(
    chorus: _Chorus, messages: DroneMessages, *, per_s: float, pid: int, seconds: float
) -> Step:
    messages.begin()
    before, began_s = CpuReading.of({"broker": pid, "own": os.getpid()}), time.monotonic()
    sent = await chorus.send(per_s, seconds=seconds)
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(_LAST_WITHIN_S):
            while len(messages.late_s) < sent:  # noqa: ASYNC110 - the counts have no event
                await asyncio.sleep(_BEAT_S)
    took_s = time.monotonic() - began_s
    usage = CpuReading.of({"broker": pid, "own": os.getpid()}).since(before)
    late_s = sorted(messages.late_s) + [math.inf] * (sent - len(messages.late_s))
    return Step(
        sent_per_s=sent / seconds,
        received_per_s=len(messages.late_s) / took_s,
        late_p50_s=late_s[len(late_s) // 2],
        late_p99_s=late_s[int(len(late_s) * 0.99)],
        broker_cores=usage.seconds["broker"] / took_s,
        own_cores=(usage.seconds["own"] - usage.seconds["broker"]) / took_s,
    )


def _connected(url: str, drone: EnrolledDrone) -> AbstractAsyncContextManager[PlainSender]:
    address = urlsplit(url)
    return plain_sender(
        address.hostname or "",
        address.port or 0,
        user_name=drone.user_name,
        password=drone.mqtt.password,
    )


def _table(steps: Sequence[Step]) -> Table:
    kept = [step.sent_per_s for step in steps if step.late_p99_s <= LIMIT_S]
    rows: list[tuple[str, ...]] = [
        (
            f"{step.sent_per_s:,.0f}",
            f"{step.received_per_s:,.0f}",
            f"{step.late_p50_s:.3f} s",
            f"{step.late_p99_s:.3f} s",
            f"{step.broker_cores:.2f}",
            f"{step.own_cores:.2f}",
        )
        for step in steps
    ]
    return Table(
        "fleet-embedded",
        f"The embedded broker with {_SENDERS} drones that send and one service that listens; one "
        f"message in {_STATE_EVERY} is a state, the others are samples.",
        ("sent/s", "received/s", "late, p50", "late, p99", "broker, cores", "we, cores"),
        rows,
        [f"Deliveries stay under {LIMIT_S:g} s up to {max(kept, default=0.0):,.0f} messages/s."],
    )
