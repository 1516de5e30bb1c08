"""A fleet in one agent process: what it takes while all stand, and while all fly."""

import asyncio
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from skyway_lab.benchmarks.fleet.agents import agent, resident_mib
from skyway_lab.benchmarks.fleet.cloud_messages import publish_clock, send_missions
from skyway_lab.benchmarks.fleet.crew import accounts_of, crew_of
from skyway_lab.benchmarks.fleet.drone_messages import DroneMessages, receiving
from skyway_lab.benchmarks.fleet.own_broker import own_mosquitto
from skyway_lab.benchmarks.load.cpu import CpuReading
from skyway_lab.benchmarks.planner.table import Table

#: What the issue allows 1,000 drones.
CORES, MIB = 1.0, 300.0

#: Wall seconds: until all are there, to send all off, before measuring, and of measuring.
_ONLINE_WITHIN_S: Final = 60.0
_SEND_OFF_S: Final = 10.0
_AIRBORNE_WITHIN_S: Final = 40.0
_SETTLE_S: Final = 12.0


@dataclass(frozen=True, slots=True)
class Taken:
    """What a window of seconds took, and the messages in it."""

    agent_cores: float
    broker_cores: float
    resident_mib: float
    states_per_s: float
    samples_per_s: float
    late_p99_s: float


async def host(drones: int, *, scenario: str, seed: int, seconds: float) -> Table:
    """Run one agent with so many drones and measure what it takes."""
    crew = crew_of(drones, seed=seed)
    with tempfile.TemporaryDirectory(prefix="skyway-fleet-") as name:
        folder = Path(name)
        with own_mosquitto(folder, accounts_of(crew)) as broker:
            await publish_clock(broker.services_url)
            async with receiving(broker.services_url) as messages:
                began_s = time.monotonic()
                with agent(folder, crew, mqtt_url=broker.drones_url, scenario=scenario) as pid:
                    pids = {"agent": pid, "broker": broker.pid}
                    await messages.wait_online(drones, within_s=_ONLINE_WITHIN_S)
                    online_s = time.monotonic() - began_s
                    await asyncio.sleep(_SETTLE_S)
                    standing = await _taken(pids, messages, seconds=seconds)
                    await send_missions(broker.services_url, crew, seed=seed, over_s=_SEND_OFF_S)
                    await messages.wait_airborne(drones, within_s=_AIRBORNE_WITHIN_S)
                    await asyncio.sleep(_SETTLE_S)
                    flying = await _taken(pids, messages, seconds=seconds)
                    airborne = len(messages.airborne)
    return _table(drones, standing, flying, airborne=airborne, online_s=online_s)


async def _taken(pids: dict[str, int], messages: DroneMessages, *, seconds: float) -> Taken:
    messages.begin()
    before, before_s = CpuReading.of(pids), time.monotonic()
    await asyncio.sleep(seconds)
    usage, lasted_s = CpuReading.of(pids).since(before), time.monotonic() - before_s
    late_s = sorted(messages.late_s)
    return Taken(
        agent_cores=usage.seconds["agent"] / lasted_s,
        broker_cores=usage.seconds["broker"] / lasted_s,
        resident_mib=resident_mib(pids["agent"]),
        states_per_s=messages.states / lasted_s,
        samples_per_s=messages.samples / lasted_s,
        late_p99_s=late_s[int(len(late_s) * 0.99)] if late_s else 0.0,
    )


def _table(drones: int, standing: Taken, flying: Taken, *, airborne: int, online_s: float) -> Table:
    both = (standing, flying)
    rows: list[tuple[str, ...]] = [
        ("agent, share of one core", *(f"{one.agent_cores:.2f}" for one in both)),
        (
            "agent, ms a drone and second",
            *(f"{1e3 * one.agent_cores / drones:.3f}" for one in both),
        ),
        ("agent, MiB resident", *(f"{one.resident_mib:.0f}" for one in both)),
        ("Mosquitto, share of one core", *(f"{one.broker_cores:.2f}" for one in both)),
        ("states a second", *(f"{one.states_per_s:.1f}" for one in both)),
        ("samples a second", *(f"{one.samples_per_s:.1f}" for one in both)),
        ("written to received, p99", *(f"{1e3 * one.late_p99_s:.0f} ms" for one in both)),
    ]
    within = flying.agent_cores <= CORES and flying.resident_mib <= MIB
    return Table(
        "fleet-hosting",
        f"One agent process with {drones:,} drones at clock rate 1.",
        ("measured", "all stand", "all fly"),
        rows,
        [
            f"{airborne:,} in flight; all ONLINE {online_s:.1f} s after the start.",
            f"Sizes: {CORES:g} core and {MIB:g} MiB; {'kept' if within else 'NOT kept'}.",
        ],
    )
