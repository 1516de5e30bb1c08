"""Reports of the outbox, posted to other services."""

import asyncio
import logging
from collections.abc import Awaitable, Mapping
from typing import Any, Final, Protocol

from sqlalchemy import Row

from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.metrics import count
from skyway.runtime.outbox.again import Again, backing_off
from skyway.runtime.outbox.gathered_reports import GatheredReports
from skyway.runtime.outbox.paces import unhurried
from skyway.runtime.outbox.stream_sender import StreamSender
from skyway.runtime.sql.database import Database

log = logging.getLogger(__name__)

#: Seconds of wall time until a report is sent again: doubled from the first to the last.
_UNANSWERED_S: Final = (0.2, 10.0)

#: 4xx that a later try can overcome; 409 says "not yet".
_LATER_STATUSES: Final = (408, 409, 425, 429)


class ServicePort(Protocol):
    """What the sender needs of a client of another service."""

    def call(self, method: str, path: str, *, body: bytes) -> Awaitable[None]:
        """Ask the service, in JSON; RemoteProblem for 4xx, ServiceUnavailable for no answer."""
        ...


class ReportSender:
    """Posts this database's reports, to each service on its own.

    Reports for a path of `together` that are found in one look travel in one request to the path
    that it names (`GatheredReports`): a request costs more than the reports in it. Whatever goes
    wrong with them, each is repeated alone, so that none that is refused or slow holds another.
    """

    def __init__(
        self,
        db: Database,
        clients: Mapping[str, ServicePort],
        clock: FleetClock,
        *,
        together: Mapping[str, str] | None = None,
    ) -> None:
        self._clients = clients
        self._together = together or {}
        self._gathering: dict[tuple[str, str], GatheredReports] = {}
        self._senders = [
            StreamSender(db, service, self._post, clock=clock, pace=unhurried())
            for service in clients
        ]

    async def run(self) -> None:
        """Post for ever."""
        async with asyncio.TaskGroup() as group:
            for sender in self._senders:
                group.create_task(sender.run())

    async def _post(self, row: Row[Any]) -> Again | None:
        path = self._together.get(row.address)
        if path is None or row.attempts:
            return await self._post_alone(row)
        key = (row.channel, path)
        reports = self._gathering.get(key)
        if reports is not None and reports.take(row):
            return None if await reports.taken() else backing_off(row, _UNANSWERED_S)
        reports = self._gathering[key] = GatheredReports(row)
        with reports.being_posted():
            # The rows of one look are posted by tasks that begin in one round of the event loop.
            await asyncio.sleep(0)
            if self._gathering.get(key) is reports:
                del self._gathering[key]
            if reports.is_one:
                return await self._post_alone(row)
            return await self._post_gathered(row, path, reports)

    async def _post_gathered(
        self, first: Row[Any], path: str, reports: GatheredReports
    ) -> Again | None:
        try:
            await self._clients[first.channel].call("POST", path, body=reports.body())
        except (ServiceUnavailable, RemoteProblem) as error:
            log.info("gathered reports not taken", extra={"path": path, "reason": str(error)})
            return backing_off(first, _UNANSWERED_S)
        reports.were_taken()
        return None

    async def _post_alone(self, row: Row[Any]) -> Again | None:
        try:
            await self._clients[row.channel].call("POST", row.address, body=row.payload)
        except ServiceUnavailable:
            return backing_off(row, _UNANSWERED_S)
        except RemoteProblem as refusal:
            if refusal.status in _LATER_STATUSES:
                return backing_off(row, _UNANSWERED_S)
            # It can never succeed, and its stream must go on.
            count("skyway_outbox_dropped", "reports refused for good", channel=row.channel)
            log.error(  # noqa: TRY400  the receiver's reason matters, not our stack
                "report refused",
                extra={"service_name": row.channel, "path": row.address, "reason": str(refusal)},
            )
        return None
