"""Sends the messages of an outbox over MQTT, and posts its reports to other services."""

import asyncio
import json
import logging
import time
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final, Protocol

from sqlalchemy import Row

from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import MqttUnavailable, RemoteProblem, ServiceUnavailable
from skyway.runtime.loops import Pace, always
from skyway.runtime.metrics import count, observe
from skyway.runtime.outbox.stream_sender import (
    Retry,
    StreamSender,
    no_wait,
    quick_pace,
    retry_later,
    unhurried_pace,
)
from skyway.runtime.sql.database import Database

log = logging.getLogger(__name__)

#: Seconds of wall time until a message is sent again: doubled from the first to the last.
_UNCONFIRMED_S: Final = (2.0, 30.0)
#: How long a message is claimed. Longer than the 5 s that a PUBACK may take, and short enough to
#: repeat an instruction before it expires (10 s at least) when its sender was killed.
_MQTT_LEASE_S: Final = 7.0
#: The pause after the broker was lost during a publish; then `ready` waits for the broker.
_NO_BROKER_S: Final = 0.5

#: Seconds of wall time until a report is sent again: doubled from the first to the last. A
#: receiver that refuses many reports for now must not be busy with refusing them.
_UNANSWERED_S: Final = (0.2, 10.0)
_REFUSED_S: Final = (0.2, 30.0)

#: The 4xx answers after which a later attempt may succeed; 409 says "not yet".
_LATER_STATUSES: Final = (408, 409, 425, 429)

#: The most bytes of reports in one request: half of what a service accepts in one body.
_LARGEST_BATCH_BYTES: Final = 128 * 1024


class MqttPort(Protocol):
    """What the sender needs of an MQTT client."""

    async def wait_connected(self) -> None:
        """Return once the broker has accepted us."""
        ...

    async def publish_raw(
        self, name: str, payload: bytes, *, mqtt_qos: int, retained: bool
    ) -> None:
        """Publish; for `mqtt_qos` 1 return after the PUBACK, else raise MqttUnavailable."""
        ...


class MqttSender:
    """Publishes this database's messages until the receiver or the broker confirms them."""

    def __init__(
        self,
        db: Database,
        mqtt: MqttPort,
        clock: FleetClock,
        *,
        pace: Pace | None = None,
        ready: Callable[[], Awaitable[None]] | None = None,
        polls: Callable[[], bool] = always,
    ) -> None:
        self._mqtt = mqtt
        self._sender = StreamSender(
            db,
            "mqtt",
            self._publish,
            clock=clock,
            pace=pace or quick_pace(),
            lease_s=_MQTT_LEASE_S,
            ready=ready or mqtt.wait_connected,
            polls=polls,
        )

    async def run(self) -> None:
        """Publish for ever."""
        await self._sender.run()

    async def _publish(self, row: Row[Any]) -> Retry | None:
        try:
            await self._mqtt.publish_raw(
                row.address, row.payload, mqtt_qos=row.mqtt_qos, retained=row.is_retained
            )
        except MqttUnavailable:
            return Retry(after_s=_NO_BROKER_S, attempts=row.attempts)
        if row.attempts == 0:
            _observe_delay(row)
        if row.confirmed_by == "broker":
            return None
        # A broker's PUBACK is not delivery: the broker may lose what it has acknowledged.
        return retry_later(row, _UNCONFIRMED_S)


class ServicePort(Protocol):
    """What the sender needs of a client of another service."""

    def call(self, method: str, path: str, *, body: bytes) -> Awaitable[None]:
        """Call the service with JSON; RemoteProblem for 4xx, ServiceUnavailable for no answer."""
        ...


class ReportSender:
    """Posts this database's reports, to each service on its own.

    A request costs more than the reports in it. So the reports for a path of `together` that are
    found in one look travel in one request, to the path that `together` names. If that request
    fails, each of its reports is repeated alone: a report that is refused or slow holds up no
    other. After that every second try is together again, so that a slow receiver gets fewer calls.

    `paces` says how often to look for the reports to a service; the default is `unhurried_pace`.
    `ready` waits until reports may be sent.
    """

    def __init__(
        self,
        db: Database,
        clients: Mapping[str, ServicePort],
        clock: FleetClock,
        *,
        together: Mapping[str, str] | None = None,
        paces: Mapping[str, Pace] | None = None,
        ready: Callable[[], Awaitable[None]] = no_wait,
        polls: Callable[[], bool] = always,
    ) -> None:
        self._clients = clients
        self._together = together or {}
        self._batches: dict[tuple[str, str], _ReportBatch] = {}
        pace_of = {service: unhurried_pace() for service in clients} | dict(paces or {})
        self._senders = [
            StreamSender(
                db,
                service,
                self._post,
                clock=clock,
                pace=pace_of[service],
                ready=ready,
                polls=polls,
            )
            for service in clients
        ]
        for service in clients:
            _count_dropped(0, channel=service)

    async def run(self) -> None:
        """Post for ever."""
        async with asyncio.TaskGroup() as group:
            for sender in self._senders:
                group.create_task(sender.run())

    async def _post(self, row: Row[Any]) -> Retry | None:
        retry = await self._try(row)
        if retry is None:
            _observe_delay(row)
        return retry

    async def _try(self, row: Row[Any]) -> Retry | None:
        path = self._together.get(row.address)
        if path is None or row.attempts % 2:
            return await self._post_alone(row)
        key = (row.channel, path)
        batch = self._batches.get(key)
        if batch is not None and batch.add(row):
            return None if await batch.is_accepted() else retry_later(row, _UNANSWERED_S)
        batch = self._batches[key] = _ReportBatch(row)
        with batch.being_posted():
            # The rows of one look are posted by tasks that begin in one round of the event loop.
            await asyncio.sleep(0)
            if self._batches.get(key) is batch:
                del self._batches[key]
            if batch.has_one_report:
                return await self._post_alone(row)
            return await self._post_batch(row, path, batch)

    async def _post_batch(self, first: Row[Any], path: str, batch: "_ReportBatch") -> Retry | None:
        try:
            await self._clients[first.channel].call("POST", path, body=batch.body())
        except (ServiceUnavailable, RemoteProblem) as error:
            log.info("batch of reports not accepted", extra={"path": path, "reason": str(error)})
            return retry_later(first, _UNANSWERED_S)
        batch.accepted()
        return None

    async def _post_alone(self, row: Row[Any]) -> Retry | None:
        try:
            await self._clients[row.channel].call("POST", row.address, body=row.payload)
        except ServiceUnavailable:
            return retry_later(row, _UNANSWERED_S)
        except RemoteProblem as refusal:
            if refusal.status in _LATER_STATUSES:
                return retry_later(row, _REFUSED_S)
            # The report can never succeed, and its stream must go on.
            _count_dropped(1, channel=row.channel)
            log.error(  # noqa: TRY400  the receiver's reason matters, not our stack
                "report refused",
                extra={"service_name": row.channel, "path": row.address, "reason": str(refusal)},
            )
        return None


class _ReportBatch:
    """Reports for one path of one service in one request. The task of the first row posts it.

    Any: the rows have the columns of `outbox_table`.
    """

    def __init__(self, first: Row[Any]) -> None:
        self._rows = [first]
        self._bytes = len(first.payload)
        self._outcome: asyncio.Future[bool] = asyncio.get_running_loop().create_future()

    @property
    def has_one_report(self) -> bool:
        """Whether the first report is the only one."""
        return len(self._rows) == 1

    def add(self, row: Row[Any]) -> bool:
        """Add a row; False when there is no room for it."""
        self._bytes += len(row.payload)
        if self._bytes > _LARGEST_BATCH_BYTES:
            return False
        self._rows.append(row)
        return True

    def body(self) -> bytes:
        """The JSON of all reports, as `skyway.contracts.mission_reports` describes it."""
        return b'{"reports":[' + b",".join(map(_with_trace, self._rows)) + b"]}"

    @contextmanager
    def being_posted(self) -> Iterator[None]:
        """Give the other tasks the outcome after the block: False unless `accepted` was called."""
        try:
            yield
        finally:
            if not self._outcome.done():
                self._outcome.set_result(False)

    def accepted(self) -> None:
        """The service has accepted all reports."""
        self._outcome.set_result(True)

    async def is_accepted(self) -> bool:
        """Wait until the batch was posted; whether the service accepted it."""
        return await asyncio.shield(self._outcome)


def _count_dropped(reports: int, *, channel: str) -> None:
    count("skyway_outbox_dropped", "reports refused for good", reports, channel=channel)


def _observe_delay(row: Row[Any]) -> None:
    delay_s = time.time() - row.stored_wall_ms / 1000
    about = "time from storing a message to its first successful send"
    observe("skyway_outbox_delay_seconds", about, delay_s, channel=row.channel)


def _with_trace(row: Row[Any]) -> bytes:
    trace = json.dumps(row.traceparent).encode()
    payload: bytes = row.payload
    return b'{"traceparent":' + trace + b',"report":' + payload + b"}"
