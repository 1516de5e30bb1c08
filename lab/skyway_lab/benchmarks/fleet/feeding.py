"""A large fleet on a whole Skyway: whether registry and composition keep up with what it says."""

import asyncio
import json
import os
import random
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone
from skyway_lab.benchmarks.fleet.agents import resident_mib
from skyway_lab.benchmarks.fleet.cloud_messages import send_missions
from skyway_lab.benchmarks.fleet.crew import read_drones
from skyway_lab.benchmarks.fleet.drone_messages import DroneMessages, receiving
from skyway_lab.benchmarks.fleet.probe import Lag, probing, wait_caught_up
from skyway_lab.benchmarks.fleet.viewing import Viewing, viewing
from skyway_lab.benchmarks.load.burst import Burst
from skyway_lab.benchmarks.load.city import City
from skyway_lab.benchmarks.load.cpu import CpuReading
from skyway_lab.benchmarks.load.storage_pair import storage_pair
from skyway_lab.benchmarks.load.world import populate
from skyway_lab.benchmarks.planner.table import Table

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import GatewayApi
from skyway.cli.system.children import Ports
from skyway.cli.system.databases import database_urls
from skyway.cli.system.running_system import System, running_system
from skyway.cli.system.secrets import read_secret
from skyway.runtime.signing.cloud_key_file import read_signing_key
from skyway.runtime.signing.seal import CloudSeal

#: What the issue wants of the newest states, seconds.
LAG_S: Final = 2.0

_STATIONS: Final = 500
_PROVIDERS: Final = 20

#: Drones at whose rows the probes look.
_PROBED: Final = 400

#: Wall seconds to send all off, for the last to be in the air, and for the rest to calm down.
_SEND_OFF_S: Final = 15.0
_AIRBORNE_WITHIN_S: Final = 60.0
_SETTLE_S: Final = 5.0
_CAUGHT_UP_WITHIN_S: Final = 60.0


@dataclass(frozen=True, slots=True)
class Fed:
    """What a window of seconds took of each process, and the messages and probes in it."""

    usage: CpuReading
    lasted_s: float
    memory_mib: Mapping[str, float]
    airborne: int
    states: int
    samples: int
    lags: Mapping[str, Lag]
    #: Wall seconds until services had taken in the start and the send-off of all.
    caught_up_s: float
    viewing: Viewing | None = None


async def feed(
    drones: int, *, flying: int, agents: int, viewers: int, seed: int, seconds: float
) -> tuple[Table, ...]:
    """Start PostgreSQL, Mosquitto, the services and the agents; have some drones fly; measure."""
    burst = Burst(
        storage="production",
        stations=_STATIONS,
        drones=drones,
        providers=_PROVIDERS,
        rate_per_s=0.0,
        seconds=seconds,
        clock_rate=1.0,
        agents=agents,
        longest_wait_s=0.0,
        seed=seed,
    )
    with tempfile.TemporaryDirectory(prefix="skyway-fleet-") as name:
        folder = DataFolder(Path(name))
        folder.make()
        with storage_pair("production", folder) as servers:
            ports = Ports(gateway=0, broker=0)
            async with running_system(folder, rate=1.0, ports=ports, say=print) as system:
                city = City.of(stations=_STATIONS, seed=seed)
                began_s = time.monotonic()
                async with GatewayApi(system.urls["gateway"]) as api:
                    key = read_secret(folder, "operator_key")
                    world = await populate(system, api, city, operator_key=key, burst=burst)
                ready_s = time.monotonic() - began_s
                pids = _pids(system, (*system.urls, *world.agents))
                pids |= {name: server.pid for name, server in servers.items()}
                fed = await _measured(system, pids, flying=flying, viewers=viewers, burst=burst)
    tables = _lags(burst, fed, ready_s=ready_s), _processes(fed)
    return tables if fed.viewing is None else (*tables, fed.viewing.table())


async def _measured(
    system: System, pids: dict[str, int], *, flying: int, viewers: int, burst: Burst
) -> Fed:
    folder, url = system.folder, os.environ["SKYWAY_MQTT_URL"]
    crew = _crew(folder, agents=burst.agents)
    chance = random.Random(burst.seed)
    probed = [drone.drone_id for drone in chance.sample(crew, min(_PROBED, len(crew)))]
    # As many of each agent's drones.
    airborne = [crew[number * len(crew) // flying] for number in range(flying)]
    password = read_secret(folder, "mqtt_registry")
    async with receiving(url, password=password) as messages:
        await send_missions(
            url,
            airborne,
            seed=burst.seed,
            over_s=_SEND_OFF_S,
            password=read_secret(folder, "mqtt_composition"),
            seal=CloudSeal(read_signing_key(folder.secrets, "composition")),
        )
        await messages.wait_airborne(flying, within_s=_AIRBORNE_WITHIN_S)
        await asyncio.sleep(_SETTLE_S)
        async with probing(await database_urls(folder), probed) as lags:
            caught_up_s = await wait_caught_up(lags, limit_s=LAG_S, within_s=_CAUGHT_UP_WITHIN_S)
            for lag in lags.values():
                lag.begin()
            window = partial(
                _window, pids, messages, lags, seconds=burst.seconds, caught_up_s=caught_up_s
            )
            if not viewers:
                return await window()
            async with viewing(
                system.urls["gateway"],
                read_secret(folder, "operator_key"),
                viewers=viewers,
                seconds=burst.seconds,
            ) as seen:
                fed = await window()
            return replace(fed, viewing=seen)


async def _window(
    pids: dict[str, int],
    messages: DroneMessages,
    lags: dict[str, Lag],
    *,
    seconds: float,
    caught_up_s: float,
) -> Fed:
    messages.begin()
    before, began_s = CpuReading.of(pids), time.monotonic()
    await asyncio.sleep(seconds)
    return Fed(
        usage=CpuReading.of(pids).since(before),
        lasted_s=time.monotonic() - began_s,
        memory_mib={name: resident_mib(pid) for name, pid in pids.items()},
        airborne=len(messages.airborne),
        states=messages.states,
        samples=messages.samples,
        lags=lags,
        caught_up_s=caught_up_s,
    )


def _crew(folder: DataFolder, *, agents: int) -> tuple[EnrolledDrone, ...]:
    """All drones, agent by agent, from the files that the agents were started with."""
    files = [folder.path / f"fleet-{number}.json" for number in range(agents)]
    return tuple(
        drone for file in files for drone in read_drones(json.loads(file.read_bytes())["items"])
    )


def _pids(system: System, names: tuple[str, ...]) -> dict[str, int]:
    found = {name: system.supervisor.pid(name) for name in names}
    return {name: pid for name, pid in found.items() if pid is not None}


def _lags(burst: Burst, fed: Fed, *, ready_s: float) -> Table:
    lags = {name: sorted(lag.seconds) for name, lag in fed.lags.items()}
    kept = all(lag and _at(lag, 0.99) < LAG_S for lag in lags.values())
    before, after = fed.airborne, fed.samples / fed.lasted_s
    saved = 1 - after / max(1, before)
    return Table(
        "fleet-feeding",
        f"{burst.drones:,} drones in {burst.agents} processes on PostgreSQL and Mosquitto, "
        f"{fed.airborne:,} in flight, clock rate 1; all AVAILABLE {ready_s:.0f} s after the first "
        "was registered.",
        ("lag of the newest", "p50", "p99", "seen"),
        [
            (name, *(f"{_at(lag, share):.2f} s" for share in (0.5, 0.99)), f"{len(lag)}")
            for name, lag in lags.items()
        ],
        [
            f"Telemetry: {before:,} samples/s, thinned to {after:,.0f}/s: {saved:.0%} less.",
            f"States: {fed.states / fed.lasted_s:.0f}/s.",
            f"All had been taken in {fed.caught_up_s:.0f} s after the last drone had taken off.",
            f"Sizes: p99 under {LAG_S:g} s; {'kept' if kept else 'NOT kept'}.",
        ],
    )


def _processes(fed: Fed) -> Table:
    memory = {name: f"{mib:.0f}" for name, mib in fed.memory_mib.items()}
    rows: list[tuple[str, ...]] = [
        (name, f"{taken_s / fed.lasted_s:.2f}", memory.get(name, ""))
        for name, taken_s in fed.usage.seconds.items()
    ]
    ours_s = sum(fed.usage.seconds.values())
    rows.append(("all of ours", f"{ours_s / fed.lasted_s:.2f}", ""))
    others_s = max(0.0, fed.usage.machine_s - ours_s)
    rows.append(("probes and everybody else", f"{others_s / fed.lasted_s:.2f}", ""))
    return Table("fleet-processes", "What each process took.", ("process", "cores", "MiB"), rows)


def _at(ordered: list[float], share: float) -> float:
    return ordered[min(len(ordered) - 1, int(len(ordered) * share))] if ordered else float("nan")
