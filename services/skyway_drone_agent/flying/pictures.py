"""Takes a picture of a hand-over that needs a PHOTO, and uploads it while the drone waits."""

import asyncio
import logging
from typing import Final, Never

from skyway.contracts.flight_step import DeliverStep
from skyway.runtime.clock import FleetClock, sleep_wall
from skyway_drone_agent.enrolment.cloud import Cloud, CloudRefused, CloudUnreachable
from skyway_drone_agent.journal.flight_recorder import FlightRecorder
from skyway_drone_agent.journal.logbook import run_under_way
from skyway_drone_agent.vehicle import Vehicle

log = logging.getLogger(__name__)

#: Wall seconds between two attempts: the cloud may not know yet that the drone waits. Our choice.
_AGAIN_S: Final = 2.0


class PictureSender:
    """Uploads pictures to the gateway; without its URL the drone can give no PHOTO."""

    def __init__(
        self, recorder: FlightRecorder, vehicle: Vehicle, clock: FleetClock, *, api_url: str
    ) -> None:
        self._recorder = recorder
        self._vehicle = vehicle
        self._clock = clock
        self._cloud = Cloud(api_url) if api_url else None
        self._news = recorder.watch()
        #: The addresses of the step under way that have taken a picture.
        self._taken: set[str] = set()

    async def run(self) -> Never:
        """Upload what the step under way awaits, again and again until the cloud has taken it."""
        while True:
            self._news.clear()
            paths = self._awaited_paths()
            self._taken.intersection_update(paths)
            missing = [path for path in paths if path not in self._taken]
            for path in missing:
                await self._upload(path)
            if missing:
                await sleep_wall(self._clock, _AGAIN_S)
            else:
                await self._news.wait()

    def _awaited_paths(self) -> tuple[str, ...]:
        run = run_under_way(self._recorder.logbook)
        if run is None or not isinstance(run.step, DeliverStep):
            return ()
        return tuple(
            each.upload_path
            for each in run.step.verification
            if each.method == "PHOTO" and each.upload_path
        )

    async def _upload(self, path: str) -> None:
        picture = await self._vehicle.photograph()
        about = {"drone_id": self._recorder.drone_id}
        if self._cloud is None or picture is None:
            log.warning("no picture of a hand-over: no camera or no gateway's URL", extra=about)
            self._taken.add(path)
            return
        try:
            await asyncio.to_thread(self._cloud.put_picture, path, picture)
        except (CloudRefused, CloudUnreachable) as error:
            # The path in it is a secret.
            log.info("picture not taken", extra={**about, "reason": str(error)})
        else:
            self._taken.add(path)
