"""Faults of processes: killed, frozen, away, without their journals."""

import random
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

from skyway_lab.benchmarks.chaos.faults.stage import Stage
from skyway_lab.benchmarks.chaos.schedule import PlannedFault

#: How many drones lose their journals together.
_FORGETFUL: Final = 3


@asynccontextmanager
async def killed(stage: Stage, fault: PlannedFault) -> AsyncIterator[None]:
    """Kill; supervised processes start again immediately, servers at the end of the block."""
    processes = stage.running.processes
    processes.kill(fault.target)
    try:
        yield
    finally:
        processes.restart_servers(fault.target)


@asynccontextmanager
async def frozen(stage: Stage, fault: PlannedFault) -> AsyncIterator[None]:
    """Freeze for the length of the block."""
    processes = stage.running.processes
    pids = processes.freeze(fault.target)
    try:
        yield
    finally:
        processes.thaw(pids)


@asynccontextmanager
async def away(stage: Stage, fault: PlannedFault) -> AsyncIterator[None]:
    """Kill, and start again at the end of the block."""
    processes = stage.running.processes
    await processes.keep_away(fault.target)
    try:
        yield
    finally:
        processes.bring_back(fault.target)


@asynccontextmanager
async def journals_lost(stage: Stage, fault: PlannedFault) -> AsyncIterator[None]:
    """Kill, remove the journals of a few drones, and start again at the end of the block."""
    async with away(stage, fault):
        stage.journals.read()
        chance = random.Random(fault.seed)
        for drone in chance.sample(stage.drones, min(_FORGETFUL, len(stage.drones))):
            stage.journals.lose(drone.drone_id)
        yield
