"""`python -m skyway_drone_agent [--fleet FILE | --enrol TOKEN --api URL] [--journal DIR] ...`."""

import asyncio
import contextlib
import logging
import os
import sys
import time
from collections import Counter
from logging.handlers import RotatingFileHandler
from typing import Final, Never

from skyway.runtime.errors import exit_code_after
from skyway.runtime.loading import keep_what_is_loaded
from skyway.runtime.loops import stop_signals
from skyway.runtime.tracing import configure_logs
from skyway_drone_agent.enrolment.enrol import Crew, EnrolledCrew, RegisteredCrew, enrol, enrolled
from skyway_drone_agent.enrolment.enrolled_drone import CredentialsFolder, read_fleet
from skyway_drone_agent.fleet import allow_open_files, host_fleet, place
from skyway_drone_agent.journal.journal import JournalFolder
from skyway_drone_agent.settings import AgentSettings, read_settings

#: A log file above this size is set aside, bytes, and how many of them are kept.
_LOG_BYTES: Final = 20 << 20
_LOGS_KEPT: Final = 4

#: Wall seconds between two lines for people, where the log goes to a file.
_LINE_EVERY_S: Final = 60.0


class News(logging.Handler):
    """Counts log records by what they say."""

    def __init__(self) -> None:
        super().__init__()
        self._counts: Counter[str] = Counter()

    def emit(self, record: logging.LogRecord) -> None:
        """Count a record; events of drones by their kind, and answers by their status."""
        more = (str(getattr(record, name, "")) for name in ("event_kind", "status"))
        self._counts[" ".join(part for part in (str(record.msg), *more) if part)] += 1

    def line(self, drones: int) -> str:
        """What happened since the last line."""
        found, self._counts = self._counts, Counter()
        what = ", ".join(f"{count} x {said}" for said, count in sorted(found.items()))
        return f"{time.strftime('%H:%M')} {drones} drones: {what or 'nothing new'}\n"


def main() -> None:
    """Serve until a signal says stop."""
    settings = read_settings(sys.argv[1:], os.environ)
    if settings.log_file is None:
        configure_logs("drone_agent", settings.log_level)
    else:
        file = RotatingFileHandler(settings.log_file, "a", _LOG_BYTES, _LOGS_KEPT)
        configure_logs("drone_agent", settings.log_level, handler=file)
    crew = _crew(settings)
    allow_open_files(len(crew.drones))
    with JournalFolder(settings.journal, (drone.drone_id for drone in crew.drones)) as folder:
        # We hold the locks of the journals now: no other process serves these drones.
        crew.settle()
        if settings.placed is not None:
            place(crew.drones, folder, settings.placed)
        if settings.enrolment.is_rotation_requested:
            crew.rotate()
        keep_what_is_loaded()
        with _runner(len(crew.drones)) as runner:
            runner.run(_serve(crew, folder, settings))


def _crew(settings: AgentSettings) -> Crew:
    if settings.fleet is not None:
        return RegisteredCrew(read_fleet(settings.fleet))
    folder, enrolment = CredentialsFolder(settings.journal), settings.enrolment
    if enrolment.token is None:
        return EnrolledCrew(enrolled(folder, drone_id=enrolment.drone_id), folder)
    return EnrolledCrew([enrol(enrolment.token, api_url=enrolment.api_url, folder=folder)], folder)


def _runner(drones: int) -> asyncio.Runner:
    """A fleet runs on uvloop where uvloop is installed; one drone does without it.

    A thousand standing drones wake the event loop a thousand times a second. A single drone has
    little memory.
    """
    if drones > 1:
        with contextlib.suppress(ImportError):
            import uvloop

            return asyncio.Runner(loop_factory=uvloop.new_event_loop)
    return asyncio.Runner()


async def _host(crew: Crew, folder: JournalFolder, settings: AgentSettings) -> None:
    """Serve the drones; start again when their credentials change."""
    while True:
        hosting = host_fleet(
            crew.drones,
            folder,
            mqtt_url=settings.mqtt_url,
            accesses=crew.accesses,
            disturbances=settings.disturbances,
            mavlink=settings.mavlink,
            api_url=settings.enrolment.api_url,
        )
        serving, changing = asyncio.create_task(hosting), asyncio.create_task(crew.changed())
        try:
            await asyncio.wait((serving, changing), return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in (serving, changing):
                task.cancel()
            # Both may say goodbye first. Reading the result raises an error of the serving task.
            await asyncio.wait((serving, changing))
        if not serving.cancelled():
            serving.result()


async def _report(drones: int) -> Never:
    """Write a line a minute, until the terminal is lost."""
    logging.getLogger().addHandler(news := News())
    while True:
        await asyncio.sleep(_LINE_EVERY_S)
        sys.stderr.write(news.line(drones))
        sys.stderr.flush()


async def _serve(crew: Crew, folder: JournalFolder, settings: AgentSettings) -> None:
    reporting = (
        None if settings.log_file is None else asyncio.create_task(_report(len(crew.drones)))
    )
    serving = asyncio.create_task(_host(crew, folder, settings))
    loop = asyncio.get_running_loop()
    if settings.parent_fd is not None:
        # Nobody writes on the parent's pipe, so it becomes readable only when the parent exits.
        loop.add_reader(settings.parent_fd, _leave, serving, settings.parent_fd)
    with (
        stop_signals(lambda _reason: serving.cancel()),
        contextlib.suppress(asyncio.CancelledError),
    ):
        await serving
    if reporting is not None:
        reporting.cancel()
        await asyncio.wait((reporting,))


def _leave(serving: asyncio.Task[None], parent_fd: int) -> None:
    # Only once: a closed pipe stays readable, and a second cancel would stop the farewell.
    asyncio.get_running_loop().remove_reader(parent_fd)
    serving.cancel()


if __name__ == "__main__":
    sys.exit(exit_code_after("skyway_drone_agent", main))
