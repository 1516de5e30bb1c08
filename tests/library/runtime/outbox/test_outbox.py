"""Messages of a transaction are sent until they are confirmed, in the order of their stream."""

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Callable
from datetime import UTC, datetime, timedelta
from itertools import pairwise

import pytest
from sqlalchemy import MetaData, func, select

from skyway.contracts.topics import CLOCK
from skyway.contracts.world import ClockAnchor
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock, ManualClock
from skyway.runtime.errors import MqttUnavailable, RemoteProblem, ServiceUnavailable
from skyway.runtime.loops import Pace, Wake
from skyway.runtime.outbox.outbox_store import confirm, outbox_table
from skyway.runtime.outbox.senders import MqttSender, ReportSender
from skyway.runtime.sql.database import Database
from skyway.runtime.tracing import current_traceparent, tracing
from tests.library.runtime.outbox.changes import Changes

METADATA = MetaData()
OUTBOX = outbox_table(METADATA)
MOMENT = datetime(2026, 3, 1, 12, tzinfo=UTC)


class Alarms(ManualClock):
    """A clock of which a test sees who sleeps, and until when."""

    def __init__(self, start: datetime) -> None:
        super().__init__(start)
        self.set_for: list[datetime] = []

    async def sleep_until(self, fleet_moment: datetime) -> None:
        self.set_for.append(fleet_moment)
        try:
            await super().sleep_until(fleet_moment)
        finally:
            self.set_for.remove(fleet_moment)


class InMemoryMqtt:
    """A broker that notes what it takes; a topic with a gate is taken once the gate opens."""

    def __init__(self) -> None:
        self.taken: list[str] = []
        self.failures = 0
        self.gates: dict[str, asyncio.Event] = {}
        self.changes = Changes()
        self.asked: list[str] = []
        self.on_taken: Callable[[], None] = lambda: None

    async def wait_connected(self) -> None:
        await asyncio.sleep(0)

    async def publish_raw(
        self, name: str, payload: bytes, *, mqtt_qos: int, retained: bool
    ) -> None:
        message_id = json.loads(payload)["message_id"]
        self.asked.append(message_id)
        self.changes.notify()
        if message_id in self.gates:
            await self.gates[message_id].wait()
        if self.failures:
            self.failures -= 1
            raise MqttUnavailable("gone")
        self.taken.append(message_id)
        self.on_taken()
        self.changes.notify()


class InMemoryService:
    """A service that notes the calls that it gets, and answers as the test has set it up."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, str, str]] = []
        self.traces: list[str | None] = []
        self.errors: list[Exception] = []
        self.is_hanging = False
        self.changes = Changes()

    async def call(self, method: str, path: str, *, body: bytes) -> None:
        self.calls.append((method, path, body.decode()))
        self.traces.append(current_traceparent())
        self.changes.notify()
        if self.is_hanging:
            await asyncio.Event().wait()
        if self.errors:
            raise self.errors.pop(0)

    def paths(self) -> list[str]:
        return [path for _, path, _ in self.calls]


class Note(JsonModel):
    text: str
    number: int = 1


@pytest.fixture
async def db(database_url: str) -> AsyncIterator[Database]:
    async with Database(database_url, outbox=OUTBOX) as opened:
        async with opened.write() as tx:
            await tx.connection.run_sync(METADATA.create_all)
        yield opened


@pytest.fixture
def clock() -> Alarms:
    return Alarms(MOMENT)


@pytest.fixture
def mqtt() -> InMemoryMqtt:
    return InMemoryMqtt()


@contextlib.asynccontextmanager
async def running(sender: MqttSender | ReportSender) -> AsyncIterator[None]:
    task = asyncio.create_task(sender.run())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def send(
    db: Database, *message_ids: str, stream: str = "s", confirmed_by: str = "broker"
) -> None:
    async with db.write() as tx:
        for message_id in message_ids:
            message = ClockAnchor(
                message_id=message_id, sent_at=MOMENT, fleet_at=MOMENT, wall_at=MOMENT, rate=1
            )
            if confirmed_by == "broker":
                tx.send(CLOCK(), message, confirmed_by="broker", stream=stream)
            else:
                tx.send(CLOCK(), message, confirmed_by="receiver", stream=stream)


async def report(db: Database, *paths: str, stream: str = "s", service: str = "gateway") -> None:
    async with db.write() as tx:
        for path in paths:
            tx.report(service, path, Note(text=path), stream=stream)


async def waiting(db: Database) -> int:
    async with db.read() as connection:
        counted = await connection.execute(select(func.count()).select_from(OUTBOX))
        return int(counted.scalar_one())


async def until_waiting(db: Database, expected: int) -> None:
    async with asyncio.timeout(60):
        while await waiting(db) != expected:
            pass


async def pass_time(db: Database, clock: Alarms, is_so: Callable[[], bool]) -> None:
    """Advance the clock to whenever somebody who rests wakes, until something is so."""
    async with asyncio.timeout(60):
        while not is_so():
            await waiting(db)
            if clock.set_for:
                clock.advance(max(min(clock.set_for) - clock.now(), timedelta(0)))


async def test_a_message_is_published_and_forgotten_after_the_puback(
    db: Database, mqtt: InMemoryMqtt, clock: FleetClock
) -> None:
    async with running(MqttSender(db, mqtt, clock)):
        await send(db, "m1")
        await mqtt.changes.until(lambda: mqtt.taken == ["m1"])
        await until_waiting(db, 0)


async def test_a_message_of_a_failed_block_is_never_sent(db: Database) -> None:
    async def fail() -> None:
        async with db.write() as tx:
            tx.report("gateway", "/a", Note(text="a"), stream="s")
            raise LookupError

    with pytest.raises(LookupError):
        await fail()

    assert await waiting(db) == 0


async def test_a_stream_keeps_its_order(
    db: Database, mqtt: InMemoryMqtt, clock: FleetClock
) -> None:
    ids = [f"m{number}" for number in range(20)]

    async with running(MqttSender(db, mqtt, clock)):
        await send(db, *ids[:10])
        await send(db, *ids[10:])
        await mqtt.changes.until(lambda: len(mqtt.taken) == 20)

    assert mqtt.taken == ids


async def test_a_stuck_stream_holds_no_other(
    db: Database, mqtt: InMemoryMqtt, clock: FleetClock
) -> None:
    mqtt.gates["stuck"] = asyncio.Event()

    async with running(MqttSender(db, mqtt, clock)):
        await send(db, "stuck", "behind", stream="one")
        await send(db, "a", "b", "c", stream="two")
        await mqtt.changes.until(lambda: mqtt.taken == ["a", "b", "c"])
        overtaken = "behind" in mqtt.asked
        mqtt.gates["stuck"].set()
        await mqtt.changes.until(lambda: mqtt.taken == ["a", "b", "c", "stuck", "behind"])

    assert not overtaken


async def test_a_message_is_repeated_until_its_receiver_confirms(
    db: Database, mqtt: InMemoryMqtt, clock: Alarms
) -> None:
    async with running(MqttSender(db, mqtt, clock, pace=Pace())):
        await send(db, "m1", "m2", confirmed_by="receiver")
        await pass_time(db, clock, lambda: mqtt.taken == ["m1", "m1", "m1"])
        async with db.write() as tx:
            known = await confirm(tx, ["m1", "m9"])
            unknown = await confirm(tx, ["m1"])
        await pass_time(db, clock, lambda: "m2" in mqtt.taken)

    assert (known, unknown) == (1, 0)
    assert mqtt.taken == ["m1", "m1", "m1", "m2"]


async def test_a_message_that_its_own_transaction_confirms_is_not_sent(db: Database) -> None:
    message = ClockAnchor(message_id="m1", sent_at=MOMENT, fleet_at=MOMENT, wall_at=MOMENT, rate=1)
    async with db.write() as tx:
        tx.send(CLOCK(), message, confirmed_by="receiver", stream="one")
        await confirm(tx, ["m1"])

    assert await waiting(db) == 0


@pytest.mark.databases("sqlite")
async def test_repeats_back_off_from_2_to_30_seconds(
    db: Database, mqtt: InMemoryMqtt, clock: Alarms
) -> None:
    taken_at: list[datetime] = []
    mqtt.on_taken = lambda: taken_at.append(clock.wall_now())

    async with running(MqttSender(db, mqtt, clock, pace=Pace())):
        await send(db, "m1", confirmed_by="receiver")
        await pass_time(db, clock, lambda: len(taken_at) == 7)

    gaps = [round((later - earlier).total_seconds()) for earlier, later in pairwise(taken_at)]
    assert gaps == [2, 4, 8, 16, 30, 30]


async def test_a_message_is_sent_when_the_broker_is_back(
    db: Database, mqtt: InMemoryMqtt, clock: Alarms
) -> None:
    mqtt.failures = 2

    async with running(MqttSender(db, mqtt, clock, pace=Pace())):
        await send(db, "m1")
        await pass_time(db, clock, lambda: mqtt.taken == ["m1"])

    assert mqtt.asked == ["m1", "m1", "m1"]


async def test_nothing_is_lost_when_a_sender_dies_between_sending_and_deleting(
    db: Database, mqtt: InMemoryMqtt, clock: Alarms
) -> None:
    mqtt.gates["m1"] = asyncio.Event()

    async with running(MqttSender(db, mqtt, clock)):
        await send(db, "m1", "m2")
        await mqtt.changes.until(lambda: mqtt.asked == ["m1"])
    del mqtt.gates["m1"]
    left = await waiting(db)
    clock.advance(timedelta(seconds=7))  # for as long as the dead sender held it
    async with running(MqttSender(db, mqtt, clock)):
        await mqtt.changes.until(lambda: mqtt.taken == ["m1", "m2"])

    assert left == 2


#: A SQLite file has one process: there are no replicas on it.
ON_POSTGRESQL = pytest.mark.parametrize(
    "database_url", [pytest.param("postgresql", marks=pytest.mark.integration)], indirect=True
)


@ON_POSTGRESQL
async def test_two_replicas_send_each_message_once(
    db: Database, mqtt: InMemoryMqtt, clock: FleetClock
) -> None:
    ids = {f"m{number}" for number in range(30)}

    async with running(MqttSender(db, mqtt, clock)), running(MqttSender(db, mqtt, clock)):
        for message_id in ids:
            await send(db, message_id, stream=message_id)
        await mqtt.changes.until(lambda: len(mqtt.taken) >= 30)
        await until_waiting(db, 0)

    assert sorted(mqtt.taken) == sorted(ids)


@ON_POSTGRESQL
async def test_a_message_that_is_being_confirmed_holds_up_no_other(
    db: Database, mqtt: InMemoryMqtt, clock: Alarms
) -> None:
    async with running(MqttSender(db, mqtt, clock)):
        await send(db, "m1", stream="one", confirmed_by="receiver")
        await mqtt.changes.until(lambda: mqtt.taken == ["m1"])
        async with db.write() as tx:
            await confirm(tx, ["m1"])
            clock.advance(timedelta(seconds=3))  # the message is due again
            # A look at the table that began before may find the first of these messages.
            await send(db, "m2", stream="two")
            await mqtt.changes.until(lambda: mqtt.taken == ["m1", "m2"])
            await send(db, "m3", stream="two")
            await mqtt.changes.until(lambda: mqtt.taken == ["m1", "m2", "m3"])


@ON_POSTGRESQL
async def test_a_message_is_not_published_twice_while_its_puback_may_still_come(
    db: Database, mqtt: InMemoryMqtt, clock: Alarms
) -> None:
    mqtt.gates["m1"] = asyncio.Event()
    await send(db, "m1", stream="one")

    async with running(MqttSender(db, mqtt, clock)):
        await mqtt.changes.until(lambda: mqtt.asked == ["m1"])
    clock.advance(timedelta(seconds=5))  # for as long as the broker may take
    async with running(MqttSender(db, mqtt, clock)):
        await send(db, "m2", stream="two")
        await mqtt.changes.until(lambda: mqtt.taken == ["m2"])

    assert mqtt.asked == ["m1", "m2"]


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
async def test_a_sender_that_starts_leaves_the_messages_of_other_channels_claimed(
    db: Database, mqtt: InMemoryMqtt, clock: Alarms
) -> None:
    mqtt.gates["m1"] = asyncio.Event()
    gateway = InMemoryService()
    await send(db, "m1", stream="one")

    async with running(MqttSender(db, mqtt, clock)):
        await mqtt.changes.until(lambda: mqtt.asked == ["m1"])
        async with running(ReportSender(db, {"gateway": gateway}, clock)):
            await report(db, "/a")
            await gateway.changes.until(lambda: gateway.paths() == ["/a"])
        await send(db, "m2", stream="two")
        await mqtt.changes.until(lambda: mqtt.taken == ["m2"])

    assert mqtt.asked == ["m1", "m2"]


async def test_a_report_is_posted_as_it_was_written(db: Database, clock: FleetClock) -> None:
    gateway = InMemoryService()

    async with running(ReportSender(db, {"gateway": gateway}, clock)):
        with tracing(None) as traceparent:
            await report(db, "/internal/a")
        await gateway.changes.until(lambda: bool(gateway.calls))
        await until_waiting(db, 0)

    assert gateway.calls == [("POST", "/internal/a", '{"text":"/internal/a","number":1}')]
    assert (gateway.traces[0] or "")[3:35] == traceparent[3:35]


@pytest.mark.databases("sqlite")
@pytest.mark.parametrize(
    "error",
    [
        ServiceUnavailable("gateway", "down"),
        *(RemoteProblem(status, {"title": "later"}) for status in (408, 409, 425, 429)),
    ],
)
async def test_a_report_is_repeated_until_it_is_accepted(
    db: Database, clock: Alarms, error: Exception
) -> None:
    gateway = InMemoryService()
    gateway.errors = [error, error]

    async with running(ReportSender(db, {"gateway": gateway}, clock)):
        await report(db, "/a", "/b")
        await pass_time(db, clock, lambda: "/b" in gateway.paths())

    assert gateway.paths() == ["/a", "/a", "/a", "/b"]


async def test_a_report_that_can_never_succeed_is_dropped_and_logged(
    db: Database, clock: FleetClock, caplog: pytest.LogCaptureFixture
) -> None:
    gateway = InMemoryService()
    gateway.errors = [RemoteProblem(422, {"detail": "field missing"})]

    async with running(ReportSender(db, {"gateway": gateway}, clock)):
        await report(db, "/a", "/b")
        await gateway.changes.until(lambda: gateway.paths() == ["/a", "/b"])

    assert [record.getMessage() for record in caplog.records] == ["report refused"]


async def test_a_service_that_hangs_holds_no_other(db: Database, clock: FleetClock) -> None:
    gateway, registry = InMemoryService(), InMemoryService()
    gateway.is_hanging = True

    async with running(ReportSender(db, {"gateway": gateway, "registry": registry}, clock)):
        await report(db, "/a", service="gateway")
        await report(db, "/b", service="registry")
        await registry.changes.until(lambda: registry.paths() == ["/b"])


async def test_a_commit_wakes_only_the_sender_of_its_channel(db: Database) -> None:
    woken: list[str] = []

    class Sleeper(Wake):
        def __init__(self, channel: str) -> None:
            super().__init__()
            self.channel = channel

        def set(self) -> None:
            woken.append(self.channel)

    for channel in ("mqtt", "gateway", "registry"):
        db.wake_when_sent(Sleeper(channel), channel=channel)

    await report(db, "/a", "/b", service="registry")
    async with db.write():
        pass

    assert woken == ["registry"]


async def test_a_database_without_an_outbox_sends_nothing(database: Database) -> None:
    with pytest.raises(RuntimeError, match="without an outbox"):
        async with database.write() as tx:
            tx.report("gateway", "/a", Note(text="a"), stream="s")
