"""One run: a whole Skyway started, populated, broken again and again, left in peace, and judged."""

import asyncio
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime
from typing import Final

from skyway_lab.benchmarks.chaos.cast import Cast, cast_for
from skyway_lab.benchmarks.chaos.faults.acting import acting
from skyway_lab.benchmarks.chaos.judgement import Flaw, flaws_in
from skyway_lab.benchmarks.chaos.outcome import Outcome
from skyway_lab.benchmarks.chaos.recovery import Healed, recoveries
from skyway_lab.benchmarks.chaos.schedule import LEAST_CALM_S, faults_for, schedule
from skyway_lab.benchmarks.chaos.service_flaws import answer_flaws, verify_flaws
from skyway_lab.benchmarks.chaos.settling import evidence_of, settled, warmed_up
from skyway_lab.benchmarks.chaos.small_disk import SmallDisk, small_disk
from skyway_lab.benchmarks.chaos.system import chaos_system
from skyway_lab.benchmarks.chaos.traces import keep_databases, keep_traces, run_folder
from skyway_lab.benchmarks.chaos.trial import Trial
from skyway_lab.benchmarks.chaos.webhooks import WebhookServer
from skyway_lab.benchmarks.load.storage_pair import storage_pair

from skyway.cli.data_folder import DataFolder
from skyway.cli.system.databases import database_urls
from skyway.ids import DeliveryId

#: Wall seconds after which the next fault comes though the system has not recovered.
_RECOVERS_WITHIN_S: Final = 60.0


async def run(trial: Trial) -> Outcome:
    """The run from its first process to its last; of one with flaws the traces are kept."""
    with (
        run_folder() as folder,
        storage_pair(trial.storage, folder) as servers,
        _disk(trial, folder) as disk,
    ):
        async with (
            WebhookServer() as webhooks,
            chaos_system(trial, folder, servers, webhooks=webhooks.address) as running,
            cast_for(trial, running, webhooks, disk) as cast,
        ):
            outcome = await _played(cast)
        if outcome.flaws:
            kept = keep_traces(folder)
            if trial.storage == "production":
                await asyncio.to_thread(keep_databases, kept, await database_urls(folder))
        return outcome


@contextmanager
def _disk(trial: Trial, folder: DataFolder) -> Iterator[SmallDisk | None]:
    if trial.storage == "embedded":
        with small_disk(folder) as disk:
            yield disk
    else:
        yield None


async def _played(cast: Cast) -> Outcome:
    gave_up = asyncio.create_task(cast.running.system.supervisor.failed())
    await warmed_up(cast)
    requests = cast.city.requests(
        rate_per_s=cast.trial.rate_per_s, seconds=cast.trial.seconds, seed=cast.trial.seed
    )
    healed: list[Healed] = []
    requesting = asyncio.create_task(cast.customers.request_all(cast.client, requests))
    breaking = asyncio.create_task(_break_again_and_again(cast, healed))
    await asyncio.wait((breaking, gave_up), return_when=asyncio.FIRST_COMPLETED)
    if gave_up.done():
        # Nothing would end any more: there is no need to wait for it.
        await _ended(breaking, requesting)
        quiet_s = 0.0
    else:
        await breaking
        await requesting
        _say("no more faults")
        quiet_s = await settled(cast)
    evidence = await evidence_of(cast)
    flaws = [*flaws_in(evidence), *answer_flaws(cast.customers.requests)]
    if gave_up.done():
        flaws.append(Flaw("gave up", None, str(gave_up.exception())))
    gave_up.cancel()
    flaws += await asyncio.to_thread(verify_flaws, cast.running.system.folder)
    return Outcome(
        trial=cast.trial,
        flaws=tuple(flaws),
        recoveries=tuple(recoveries(healed, _accepted_at(cast), cast.streams.received)),
        requests=cast.customers.requests,
        evidence=evidence,
        quiet_s=quiet_s,
    )


async def _ended(*tasks: "asyncio.Task[None]") -> None:
    for task in tasks:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


async def _break_again_and_again(cast: Cast, healed: list[Healed]) -> None:
    """Make all faults of the schedule, one after another, and note when each has healed."""
    trial = cast.trial
    has_disk = cast.stage.disk is not None
    faults = faults_for(trial.storage, only=trial.only, without=trial.without, is_root=has_disk)
    shortest_s = min(kind.lasts_s[0] for kind, _ in faults)
    ends_s = time.monotonic() + trial.seconds
    for fault in schedule(faults, seed=trial.seed):
        left_s = ends_s - time.monotonic()
        if left_s < shortest_s + LEAST_CALM_S:
            break
        if left_s < fault.calm_s + fault.kind.lasts_s[0]:
            continue
        if fault.waits_for_recovery and healed:
            await _recovered(cast, healed[-1], before_s=ends_s)
        await asyncio.sleep(fault.calm_s)
        if healed:
            healed[-1] = replace(healed[-1], next_fault_s=time.monotonic())
        _say(f"{fault.name} for {fault.lasts_s:.0f} s")
        cast.customers.fault = fault.name
        async with acting(cast.stage, fault):
            await asyncio.sleep(fault.lasts_s)
        healed.append(Healed(fault.name, time.monotonic()))
        # Without it the next request could come a second later.
        cast.customers.request(cast.client, _one_more(cast, fault.seed))
    await asyncio.sleep(max(0.0, ends_s - time.monotonic()))


async def _recovered(cast: Cast, last: Healed, *, before_s: float) -> None:
    """Return when a request that was accepted after this fault is dispatched, or in bounded time.

    `before_s` is monotonic.
    """
    before_s = min(before_s, time.monotonic() + _RECOVERS_WITHIN_S)
    while time.monotonic() < before_s:
        [found] = recoveries([last], _accepted_at(cast), cast.streams.received)
        if found.dispatched_s is not None:
            return
        await asyncio.sleep(0.5)


def _one_more(cast: Cast, seed: int) -> bytes:
    return next(cast.city.requests(rate_per_s=1.0, seconds=1_000.0, seed=seed)).body


def _accepted_at(cast: Cast) -> dict[DeliveryId, float]:
    return {
        delivery_id: each.at_s for delivery_id, each in cast.customers.requests.accepted.items()
    }


def _say(words: str) -> None:
    print(f"{datetime.now(UTC):%H:%M:%S} {words}", flush=True)
