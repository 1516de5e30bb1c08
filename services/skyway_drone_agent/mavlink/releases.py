"""Letting packages go: once for each hand-over, since what was dropped cannot be dropped again."""

import asyncio
from datetime import datetime
from typing import Final

from skyway.runtime.clock import FleetClock, sleep_wall
from skyway_drone_agent.mavlink.link import MavlinkLink, command_once
from skyway_drone_agent.mavlink.settings import MavlinkSettings
from skyway_drone_agent.vehicle import StepRun

#: Wall seconds between two tries while the autopilot cannot let go yet.
_AGAIN_S: Final = 2.0


class Releases:
    """Remembers the newest hand-over; number and start identify a step."""

    def __init__(self, link: MavlinkLink, clock: FleetClock, settings: MavlinkSettings) -> None:
        self._link = link
        self._clock = clock
        self._settings = settings
        self._newest: tuple[tuple[int, datetime], asyncio.Task[bool | None]] | None = None

    async def release(self, run: StepRun) -> bool | None:
        """Whether the autopilot has let go for this step; None when nobody knows."""
        if self._newest is None or self._newest[0] != _key(run):
            self._newest = (_key(run), asyncio.create_task(self._let_go()))
        # Shielded: a step that is taken up again goes on with the same release.
        return await asyncio.shield(self._newest[1])

    def result_of(self, run: StepRun) -> bool | None:
        """Whether this process has seen it done; autopilots do not remember it."""
        if self._newest is None or self._newest[0] != _key(run) or not self._newest[1].done():
            return None
        return self._newest[1].result()

    async def _let_go(self) -> bool | None:
        dialect = self._link.dialect
        command_id, *params = self._settings.payload.command(dialect)
        while True:
            result = await command_once(
                self._link, int(command_id), *params, timeout_s=self._settings.release_s
            )
            if result == dialect.MAV_RESULT_TEMPORARILY_REJECTED:
                await sleep_wall(self._clock, _AGAIN_S)
                continue
            return None if result is None else result == dialect.MAV_RESULT_ACCEPTED


def _key(run: StepRun) -> tuple[int, datetime]:
    return run.step.step_id, run.started_at
