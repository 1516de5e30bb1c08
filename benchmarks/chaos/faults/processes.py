"""Faults of processes: killed, frozen, away."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from benchmarks.chaos.faults.stage import Stage
from benchmarks.chaos.schedule import PlannedFault


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
