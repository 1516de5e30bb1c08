"""One run: a whole Skyway, calm and then attacked by rogues, left in peace, and judged."""

import asyncio
import json
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from skyway_lab.benchmarks.chaos.cast import Cast, cast_for
from skyway_lab.benchmarks.chaos.judgement import Flaw, flaws_in
from skyway_lab.benchmarks.chaos.processes import Processes
from skyway_lab.benchmarks.chaos.service_flaws import answer_flaws, verify_flaws
from skyway_lab.benchmarks.chaos.settling import evidence_of, settled, warmed_up
from skyway_lab.benchmarks.chaos.system import chaos_system
from skyway_lab.benchmarks.chaos.traces import keep_databases, keep_traces, run_folder
from skyway_lab.benchmarks.chaos.webhooks import WebhookServer
from skyway_lab.benchmarks.hostile.judgement import flaws_of
from skyway_lab.benchmarks.hostile.probes import Seconds, deliveries_between, middle, probing
from skyway_lab.benchmarks.hostile.rogues import Answers, attacking, register_rogues
from skyway_lab.benchmarks.hostile.stories import stories_played
from skyway_lab.benchmarks.hostile.trial import Trial
from skyway_lab.benchmarks.load.city import DueRequest
from skyway_lab.benchmarks.load.storage_pair import storage_pair
from skyway_lab.benchmarks.planner.table import Table

from skyway.cli.system.databases import database_urls
from skyway.ids import ProviderId

#: Whose memory is looked at.
_PROCESSES: Final = ("gateway", "composition", "registry", "broker")
_MIB: Final = 2**20
_PAGE: Final = os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True, slots=True)
class Outcome:
    """A run's flaws and figures; seconds of wall time by what was done."""

    flaws: tuple[Flaw, ...]
    answers: Answers
    calm: Seconds
    attacked: Seconds
    growth_mib: Mapping[str, float] = field(default_factory=dict)

    def tables(self) -> list[Table]:
        """What a run prints."""
        return [self._paces(), self._rogues(), self._memory()]

    def _paces(self) -> Table:
        rows: list[tuple[str, ...]] = []
        for what, seconds in self.calm.items():
            before_s, now_s = middle(seconds), middle(self.attacked.get(what, ()))
            rows.append((what, _in_seconds(before_s), _in_seconds(now_s), _ratio(before_s, now_s)))
        return Table(
            "hostile-pace",
            "What honest people do: median wall seconds.",
            ("what", "calm", "attacked", "times"),
            rows,
        )

    def _rogues(self) -> Table:
        rows: list[tuple[str, ...]] = [
            (answer, str(count)) for answer, count in sorted(self.answers.counts.items())
        ]
        rows.append(("messages published", str(self.answers.messages)))
        most = self.answers.variants
        rows += [
            (f"extreme values, {name}", f"{min(sent, most)} of {most}")
            for name, sent in self.answers.sent.items()
        ]
        return Table("hostile-rogues", "How rogues were answered.", ("answer", "times"), rows)

    def _memory(self) -> Table:
        rows: list[tuple[str, ...]] = [
            (name, f"{grown:.0f}") for name, grown in self.growth_mib.items()
        ]
        return Table("hostile-memory", "Growth under attack.", ("process", "MiB"), rows)


def _in_seconds(seconds: float | None) -> str:
    return "never" if seconds is None else f"{seconds:.3f}"


def _ratio(before_s: float | None, now_s: float | None) -> str:
    return f"{now_s / before_s:.2f}" if before_s and now_s else ""


async def run(trial: Trial) -> Outcome:
    """The run from its first process to its last; of one with flaws the traces are kept."""
    chaos = trial.as_chaos()
    with run_folder() as folder, storage_pair(trial.storage, folder) as servers:
        async with (
            WebhookServer() as webhooks,
            chaos_system(chaos, folder, servers, webhooks=webhooks.address) as running,
            cast_for(chaos, running, webhooks, None) as cast,
        ):
            outcome = await _played(trial, cast)
        if outcome.flaws:
            kept = keep_traces(folder)
            if trial.storage == "production":
                await asyncio.to_thread(keep_databases, kept, await database_urls(folder))
        return outcome


async def _played(trial: Trial, cast: Cast) -> Outcome:
    await warmed_up(cast)
    first = await _phase(trial, cast, seed=trial.seed)
    before = _memory_mib(cast.running.processes)
    rogues = await register_rogues(cast)
    async with attacking(cast, rogues, seed=trial.seed) as answers:
        second = await _phase(trial, cast, seed=trial.seed + 1)
    after = _memory_mib(cast.running.processes)
    await settled(cast)
    # On a slow machine the last requests are planned after their phase.
    calm, attacked = first.seconds(cast), second.seconds(cast)
    lies = await stories_played(cast)
    growth_mib = {name: after[name] - before[name] for name in before}
    flaws = [
        *flaws_of(
            answers,
            calm=calm,
            attacked=attacked,
            growth_mib=growth_mib,
            most_times=trial.most_times,
        ),
        *(
            each
            for each in flaws_in(await evidence_of(cast))
            if each.delivery_id not in answers.deliveries
        ),
        *lies,
        *answer_flaws(cast.customers.requests),
        *await asyncio.to_thread(verify_flaws, cast.running.system.folder),
    ]
    return Outcome(tuple(flaws), answers, calm, attacked, growth_mib)


@dataclass(frozen=True, slots=True)
class _Phase:
    """What honest people did between two moments, monotonic seconds."""

    done: Seconds
    from_s: float
    until_s: float

    def seconds(self, cast: Cast) -> Seconds:
        """How long each thing took, with what was planned until now."""
        return {**self.done, **deliveries_between(cast, self.from_s, self.until_s)}


async def _phase(trial: Trial, cast: Cast, *, seed: int) -> _Phase:
    """Let honest people do what they do for a while."""
    started_s = time.monotonic()
    every = cast.city.requests(rate_per_s=trial.rate_per_s, seconds=trial.phase_s, seed=seed)
    requests = (_without_rogue(each, cast.stage.rogue.provider_id) for each in every)
    async with probing(cast) as probes:
        await cast.customers.request_all(cast.client, requests)
        await asyncio.sleep(max(0.0, started_s + trial.phase_s - time.monotonic()))
        await probes.finish_first_round()
    # On a slow machine the last answers come after the phase.
    await cast.customers.all_answered(within_s=cast.trial.quiet_s)
    return _Phase(probes.found, started_s, time.monotonic())


def _without_rogue(each: DueRequest, provider_id: ProviderId) -> DueRequest:
    """The same request for other providers: nobody has to trust a provider that never comes."""
    body = json.loads(each.body)
    body["qos"]["providers"] = {"denied": [provider_id]}
    return replace(each, body=json.dumps(body).encode())


def _memory_mib(processes: Processes) -> dict[str, float]:
    """What the processes of each part hold in memory together."""
    return {name: sum(map(_resident_mib, processes.pids(name))) for name in _PROCESSES}


def _resident_mib(pid: int) -> float:
    try:
        pages = Path(f"/proc/{pid}/statm").read_text().split()[1]
    except (FileNotFoundError, ProcessLookupError):
        return 0.0
    return int(pages) * _PAGE / _MIB
