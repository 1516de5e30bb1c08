"""Messages that leave with a transaction, and are sent until somebody has them.

A row is written by `Tx.send` or `Tx.report` in the transaction of the fact it tells; the senders
here deliver it afterwards, at least once, in the order of its stream (`stream_sender`).
"""

import asyncio
import logging
from collections.abc import Awaitable, Mapping, Sequence
from functools import lru_cache
from typing import Any, Final, Protocol

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Delete,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    Row,
    Table,
    Text,
)

from skyway.runtime.among import among
from skyway.runtime.claims import claim_columns
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database, Tx
from skyway.runtime.errors import MqttUnavailable, RemoteProblem, ServiceUnavailable
from skyway.runtime.gathered_reports import GatheredReports
from skyway.runtime.metrics import count
from skyway.runtime.pace import Pace
from skyway.runtime.stream_sender import Again, StreamSender, quick, unhurried

log = logging.getLogger(__name__)

#: Seconds of wall time until a message is sent again: doubled from the first to the last.
_UNCONFIRMED_S: Final = (2.0, 30.0)
_UNANSWERED_S: Final = (0.2, 10.0)
#: How long a message is claimed: longer than the 5 s that a PUBACK may take, and short enough that
#: an instruction whose sender was killed is repeated before it expires (10 s at least).
_MQTT_LEASE_S: Final = 7.0
#: The broker went away while it was asked: once it is back, there is no reason to wait.
_NO_BROKER_S: Final = 0.5

#: 4xx that a later try can overcome; 409 says "not yet".
_LATER_STATUSES: Final = (408, 409, 425, 429)


def outbox_table(metadata: MetaData) -> Table:
    """The table of messages on their way; `channel` is ``mqtt`` or the name of a service."""
    return Table(
        "outbox",
        metadata,
        # Never reused, so that a late answer cannot delete another row.
        Column("id", BigInteger().with_variant(Integer, "sqlite"), primary_key=True),
        Column("channel", Text, nullable=False),
        Column("stream", Text, nullable=False),
        Column("address", Text, nullable=False),
        Column("payload", LargeBinary, nullable=False),
        Column("confirmed_by", Text, nullable=False),
        Column("message_id", Text),
        Column("mqtt_qos", Integer, nullable=False),
        Column("is_retained", Boolean, nullable=False),
        Column("traceparent", Text),
        Column("attempts", Integer, nullable=False, server_default="0"),
        Column("due_at_ms", BigInteger, nullable=False, server_default="0"),
        *claim_columns(),
        Index("outbox_stream", "channel", "stream", "id"),
        Index("outbox_message", "message_id"),
        sqlite_autoincrement=True,
    )


async def confirm(tx: Tx, message_ids: Sequence[str]) -> int:
    """Stop repeating these messages; how many of them were still in the outbox."""
    if not message_ids:
        return 0
    found = await tx.execute(_confirming(tx.outbox_table()), {"message_ids": message_ids})
    return found.rowcount


@lru_cache(maxsize=10)  # making it takes longer than running it; a service has one outbox
def _confirming(outbox: Table) -> Delete:
    return outbox.delete().where(among(outbox.c.message_id, "message_ids"))


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


class ServicePort(Protocol):
    """What the sender needs of a client of another service."""

    def call(self, method: str, path: str, *, body: bytes) -> Awaitable[None]:
        """Ask the service, in JSON; RemoteProblem for 4xx, ServiceUnavailable for no answer."""
        ...


class MqttSender:
    """Publishes this database's messages: until confirmed by the receiver, or by the broker."""

    def __init__(
        self, db: Database, mqtt: MqttPort, clock: FleetClock, *, pace: Pace | None = None
    ) -> None:
        self._mqtt = mqtt
        self._sender = StreamSender(
            db,
            "mqtt",
            self._publish,
            clock=clock,
            pace=pace or quick(),
            lease_s=_MQTT_LEASE_S,
            ready=mqtt.wait_connected,
        )

    async def run(self) -> None:
        """Publish for ever."""
        await self._sender.run()

    async def _publish(self, row: Row[Any]) -> Again | None:
        try:
            await self._mqtt.publish_raw(
                row.address, row.payload, mqtt_qos=row.mqtt_qos, retained=row.is_retained
            )
        except MqttUnavailable:
            return Again(after_s=_NO_BROKER_S, attempts=row.attempts)
        if row.confirmed_by == "broker":
            return None
        # A broker's PUBACK is not delivery: it may forget all that it has acknowledged.
        return _backing_off(row, _UNCONFIRMED_S)


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
            return None if await reports.taken() else _backing_off(row, _UNANSWERED_S)
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
            return _backing_off(first, _UNANSWERED_S)
        reports.were_taken()
        return None

    async def _post_alone(self, row: Row[Any]) -> Again | None:
        try:
            await self._clients[row.channel].call("POST", row.address, body=row.payload)
        except ServiceUnavailable:
            return _backing_off(row, _UNANSWERED_S)
        except RemoteProblem as refusal:
            if refusal.status in _LATER_STATUSES:
                return _backing_off(row, _UNANSWERED_S)
            # It can never succeed, and its stream must go on.
            count("skyway_outbox_dropped", "reports refused for good", channel=row.channel)
            log.error(  # noqa: TRY400  the receiver's reason matters, not our stack
                "report refused",
                extra={"service_name": row.channel, "path": row.address, "reason": str(refusal)},
            )
        return None


def _backing_off(row: Row[Any], span_s: tuple[float, float]) -> Again:
    first_s, longest_s = span_s
    after_s = min(first_s * 2.0 ** min(row.attempts, 16), longest_s)
    return Again(after_s=after_s, attempts=row.attempts + 1)
