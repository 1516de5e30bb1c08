"""Faults of connections: cut, silent, slow."""

import random
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

from skyway_lab.benchmarks.chaos.faults.stage import Stage
from skyway_lab.benchmarks.chaos.schedule import PlannedFault

_DELAY_S: Final = (0.2, 2.0)


@asynccontextmanager
async def cut(stage: Stage, fault: PlannedFault) -> AsyncIterator[None]:
    """Break the wire's connections and refuse new ones."""
    wire = stage.running.wires[fault.target]
    wire.cut()
    try:
        yield
    finally:
        wire.heal()


@asynccontextmanager
async def silenced(stage: Stage, fault: PlannedFault) -> AsyncIterator[None]:
    """Hold back everything on the wire."""
    wire = stage.running.wires[fault.target]
    wire.silence()
    try:
        yield
    finally:
        wire.heal()


@asynccontextmanager
async def slowed(stage: Stage, fault: PlannedFault) -> AsyncIterator[None]:
    """Delay everything on the wire."""
    wire = stage.running.wires[fault.target]
    wire.slow(random.Random(fault.seed).uniform(*_DELAY_S))
    try:
        yield
    finally:
        wire.heal()
