"""Stages of load on one system: what each offers, and what becomes of its requests."""

import asyncio
import json
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Final

import httpx
from skyway_lab.benchmarks.load.burst import Burst
from skyway_lab.benchmarks.load.city import City
from skyway_lab.benchmarks.load.figures import percentile
from skyway_lab.benchmarks.load.follow import Followed, following
from skyway_lab.benchmarks.load.run import data_folder, pids_of, verify, warm_up
from skyway_lab.benchmarks.load.send import Sent, send
from skyway_lab.benchmarks.load.storage_pair import storage_pair
from skyway_lab.benchmarks.load.world import World, populate
from skyway_lab.benchmarks.overload.quota import limited

from skyway.cli.gateway import GatewayApi, read_keys
from skyway.cli.system.children import Ports
from skyway.cli.system.running_system import System, running_system
from skyway.cli.system.secrets import read_secret
from skyway.contracts.delivery_event import DeliveryEventType
from skyway.ids import DeliveryId
from skyway.runtime.metrics import METRICS_KEY

#: An accepted request is planned, or its customer knows why it waits, within so many wall seconds.
ANSWERED_WITHIN_S: Final = 30.0

#: The load falls for so long before the system must be as it was before.
RECOVERY_S: Final = 120.0

#: How often it looks whether anything is left. Gauges are kept for 5 s.
_LOOKS: Final = 5
_LOOK_EVERY_S: Final = 6.0

#: Gauges, and what they may show while half of the capacity is used. Ages are in seconds.
_MOST: Final = {
    'skyway_queue_age_seconds{queue="booking"}': 10.0,
    'skyway_outbox_age_seconds{channel="gateway"}': 10.0,
    'skyway_outbox_age_seconds{channel="registry"}': 10.0,
    'skyway_outbox_age_seconds{channel="composition"}': 10.0,
    "skyway_unknown_missions": 0.0,
}


@dataclass(frozen=True, slots=True)
class Trial:
    """One run: the world, the offered multiples of the capacity, and the share of a core."""

    burst: Burst
    factors: Sequence[float]
    #: Requests that are planned a second at most; None lets the run measure it.
    capacity_per_s: float | None
    #: Requests that are sent together to measure the capacity.
    probe: int
    share: float | None


@dataclass(frozen=True, slots=True)
class Stage:
    """What one stage offered and what came of it; times are wall seconds."""

    name: str
    factor: float
    offered_per_s: float
    accepted_per_s: float
    refused: Mapping[str, int]
    #: Requests of any stage that were planned, or answered with why they wait, in this stage.
    done_per_s: float
    accept_p50_s: float | None
    accept_p99_s: float | None
    planned_p50_s: float | None
    planned_p99_s: float | None
    #: Accepted requests that were neither planned nor answered within `ANSWERED_WITHIN_S`.
    late: int
    sent_late_p99_s: float | None


@dataclass(frozen=True, slots=True)
class Finding:
    """What a run has found out."""

    capacity_per_s: float
    stages: Sequence[Stage]
    #: By how much gauges were too high after the load had fallen for `RECOVERY_S`.
    left: Mapping[str, float]
    violations: str


async def run(trial: Trial) -> Finding:
    """Start a system, load it stage by stage, and end it."""
    burst = trial.burst
    with data_folder() as folder, storage_pair(burst.storage, folder) as servers:
        async with running_system(
            folder, rate=burst.clock_rate, ports=Ports(gateway=0, broker=0), say=print
        ) as system:
            city = City.of(stations=burst.stations, seed=burst.seed)
            key = read_keys(folder)["SKYWAY_OPERATOR_KEY"]
            async with GatewayApi(system.urls["gateway"]) as api:
                world = await populate(system, api, city, operator_key=key, burst=burst)
            await warm_up(system, world, city, burst=burst)
            pids = pids_of(system, world) | {name: one.pid for name, one in servers.items()}
            with limited(pids, trial.share):
                return await _Load(system, world, city, key).all_stages(trial)


@dataclass(frozen=True, slots=True)
class _Load:
    """Sends requests to a running system; `key` is the operator's."""

    system: System
    world: World
    city: City
    key: str

    async def all_stages(self, trial: Trial) -> Finding:
        async with following(self.world, mqtt_url=self.system.mqtt_url) as followed:
            capacity_per_s = trial.capacity_per_s or await self._capacity(trial, followed)
            print(f"capacity {capacity_per_s:.2f} a second", flush=True)
            first = trial.factors[0]
            plan = [(f"{factor:g}", factor, trial.burst.seconds) for factor in trial.factors]
            plan.append(("falling", first, RECOVERY_S))
            stages = []
            for number, (name, factor, seconds) in enumerate(plan):
                asked = replace(
                    trial.burst,
                    rate_per_s=factor * capacity_per_s,
                    seconds=seconds,
                    seed=trial.burst.seed + 100 + number,
                )
                stages.append(await self._stage(name, factor, asked, followed))
            asked = replace(trial.burst, rate_per_s=first * capacity_per_s)
            async with asyncio.TaskGroup() as group:
                looking = group.create_task(self._left())
                stages.append(await self._stage("after", first, asked, followed))
            left = looking.result()
        violations = await asyncio.to_thread(verify, self.system.folder)
        return Finding(capacity_per_s, stages, left, violations)

    async def _capacity(self, trial: Trial, followed: Followed) -> float:
        """How many requests are planned a second, of those that are sent together."""
        rate_per_s = 4.0 * trial.probe
        requests = self.city.requests(rate_per_s=rate_per_s, seconds=0.25, seed=trial.burst.seed)
        sent = await send(self.system.urls["gateway"], self.world, requests)
        ends_s = time.monotonic() + 20 * ANSWERED_WITHIN_S
        planned: list[float] = []
        while len(planned) < len(sent.asked_at) and time.monotonic() < ends_s:
            await asyncio.sleep(0.5)  # many events from outside decide this
            planned = sorted(_planned_of(followed, sent).values())
        tenth = len(planned) // 10
        return 8 * tenth / (planned[9 * tenth] - planned[tenth])

    async def _stage(self, name: str, factor: float, asked: Burst, followed: Followed) -> Stage:
        requests = list(
            self.city.requests(rate_per_s=asked.rate_per_s, seconds=asked.seconds, seed=asked.seed)
        )
        began_s, sent = time.monotonic(), Sent()
        answered: dict[DeliveryId, float] = {}
        async with asyncio.TaskGroup() as group:
            watching = group.create_task(self._watch(sent, followed, answered))
            await send(self.system.urls["gateway"], self.world, requests, sent=sent)
            ended_s = max(time.monotonic(), began_s + asked.seconds)
            planned_until = len([1 for at_s in _all_planned(followed) if began_s <= at_s < ended_s])
            await _until_answered(sent, followed, answered)
            watching.cancel()
        planned = _planned_of(followed, sent)
        waited = {one: at_s for one, at_s in answered.items() if one not in planned}
        took = [planned[one] - sent.asked_at[one] for one in planned]
        late = [
            one
            for one, at_s in sent.asked_at.items()
            if min(planned.get(one, at_s + 1e9), waited.get(one, at_s + 1e9)) - at_s
            > ANSWERED_WITHIN_S + 1.0
        ]
        seconds = ended_s - began_s
        done = planned_until + sum(at_s < ended_s for at_s in waited.values())
        stage = Stage(
            name=name,
            factor=factor,
            offered_per_s=len(requests) / asked.seconds,
            accepted_per_s=len(sent.asked_at) / seconds,
            refused=dict(sent.refused),
            done_per_s=done / seconds,
            accept_p50_s=percentile(sent.answered_within_s, 50),
            accept_p99_s=percentile(sent.answered_within_s, 99),
            planned_p50_s=percentile(took, 50),
            planned_p99_s=percentile(took, 99),
            late=len(late),
            sent_late_p99_s=percentile(sent.late_s, 99),
        )
        print(stage, flush=True)
        return stage

    async def _watch(
        self, sent: Sent, followed: Followed, answered: dict[DeliveryId, float]
    ) -> None:
        """Note which deliveries know why they wait, `ANSWERED_WITHIN_S` after they were asked."""
        seen = set[DeliveryId]()
        headers = {"Authorization": f"Bearer {self.key}"}
        async with httpx.AsyncClient(
            base_url=self.system.urls["gateway"], timeout=30.0, headers=headers
        ) as client:
            while True:
                await asyncio.sleep(0.5)  # the moment of a look is part of the measurement
                before_s = time.monotonic() - ANSWERED_WITHIN_S
                settled = _planned_of(followed, sent).keys() | followed.ended | seen
                for one in [o for o, at_s in sent.asked_at.items() if at_s <= before_s]:
                    if one in settled:
                        continue
                    with suppress(httpx.HTTPError):
                        found: Any = json.loads((await client.get(f"/v1/deliveries/{one}")).text)
                        seen.add(one)
                        if found["reasons"] or found["missions"]:
                            answered[one] = sent.asked_at[one] + ANSWERED_WITHIN_S

    async def _left(self) -> dict[str, float]:
        """By how much gauges are too high at each of several looks, while the load goes on."""
        headers = {"Authorization": f"Bearer {read_secret(self.system.folder, METRICS_KEY)}"}
        looks: list[dict[str, float]] = []
        async with httpx.AsyncClient(timeout=30.0, headers=headers) as client:
            for _ in range(_LOOKS):
                look: dict[str, float] = {}
                for name in ("gateway", "composition", "registry"):
                    text = (await client.get(f"{self.system.urls[name]}/metrics")).text
                    series = (line.rpartition(" ") for line in text.splitlines())
                    over = ((one, float(n) - _MOST[one]) for one, _, n in series if one in _MOST)
                    look |= {f"{name} {one}": excess for one, excess in over}
                looks.append(look)
                await asyncio.sleep(_LOOK_EVERY_S)  # gauges are read anew
        least = {name: min(look.get(name, 0.0) for look in looks) for name in looks[0]}
        return {name: value for name, value in least.items() if value > 0}


def _all_planned(followed: Followed) -> Sequence[float]:
    return list(followed.of(DeliveryEventType.PLANNED).values())


def _planned_of(followed: Followed, sent: Sent) -> dict[DeliveryId, float]:
    planned = followed.of(DeliveryEventType.PLANNED)
    return {one: planned[one] for one in sent.asked_at if one in planned}


async def _until_answered(
    sent: Sent, followed: Followed, answered: Mapping[DeliveryId, float]
) -> None:
    """Wait until each accepted request is planned or over, or its 30 s have passed."""
    ends_s = time.monotonic() + ANSWERED_WITHIN_S + 5.0
    while time.monotonic() < ends_s:
        known = _planned_of(followed, sent).keys() | followed.ended | answered.keys()
        if known >= sent.asked_at.keys():
            return
        await asyncio.sleep(0.5)  # many events from outside decide this
