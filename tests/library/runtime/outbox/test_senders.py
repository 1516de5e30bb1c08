"""Reports that are found in one look travel in one request, and none is lost."""

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import timedelta
from types import SimpleNamespace
from typing import Any

import pytest
from sqlalchemy import MetaData, func, select

from skyway.json_model import JsonModel
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.loops import Pace
from skyway.runtime.outbox.outbox_store import outbox_table
from skyway.runtime.outbox.senders import ReportSender
from skyway.runtime.sql.database import Database
from skyway.runtime.tracing import tracing

METADATA = MetaData()
OUTBOX = outbox_table(METADATA)
TOGETHER = {"/reports": "/reports/many"}


class Note(JsonModel):
    text: str


class InMemoryService:
    """Notes the calls that it gets, and refuses bulk calls with the given errors."""

    def __init__(self, *refusals: Exception) -> None:
        self.refusals = list(refusals)
        self.alone: list[Exception] = []
        self.calls: list[tuple[str, Any]] = []

    async def call(self, method: str, path: str, *, body: bytes) -> None:
        self.calls.append((path, json.loads(body)))
        await asyncio.sleep(0)
        if path == "/reports/many" and self.refusals:
            raise self.refusals.pop(0)
        if path != "/reports/many" and self.alone:
            raise self.alone.pop(0)


@pytest.fixture
async def db(database_url: str) -> AsyncIterator[Database]:
    async with Database(database_url, outbox=OUTBOX) as opened:
        async with opened.write() as tx:
            await tx.connection.run_sync(METADATA.create_all)
        yield opened


@asynccontextmanager
async def sending(
    db: Database, service: InMemoryService, clock: ManualClock, *, pace: Pace | None = None
) -> AsyncIterator[None]:
    paces = {} if pace is None else {"gateway": pace}
    sender = ReportSender(db, {"gateway": service}, clock, together=TOGETHER, paces=paces)
    task = asyncio.create_task(sender.run())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def report(db: Database, *texts: str, path: str = "/reports") -> None:
    async with db.write() as tx:
        for text in texts:
            with tracing(None):
                tx.report("gateway", path, Note(text=text), stream=text)


def make_row(path: str, *, attempts: int) -> Any:
    """A row of the outbox that was sent so often."""
    return SimpleNamespace(
        address=path,
        channel="gateway",
        payload=b"{}",
        stored_wall_ms=0,
        traceparent=None,
        attempts=attempts,
    )


async def until_sent(db: Database, clock: ManualClock) -> None:
    async with asyncio.timeout(60):
        while True:
            async with db.read() as connection:
                if not (await connection.execute(select(func.count(OUTBOX.c.id)))).scalar_one():
                    return
            clock.advance(timedelta(seconds=0.1))


async def traces(db: Database) -> list[str]:
    async with db.read() as connection:
        found = select(OUTBOX.c.traceparent).order_by(OUTBOX.c.id)
        return list((await connection.execute(found)).scalars())


async def test_reports_found_in_one_look_travel_together_each_with_its_trace(
    db: Database, clock: ManualClock
) -> None:
    service = InMemoryService()
    await report(db, "a", "b", "c")
    of_each = await traces(db)

    async with sending(db, service, clock):
        await until_sent(db, clock)

    [(path, body)] = service.calls
    assert path == "/reports/many"
    assert body["reports"] == [
        {"traceparent": trace, "report": {"text": text}}
        for trace, text in zip(of_each, "abc", strict=True)
    ]
    assert len(set(of_each)) == 3


async def test_reports_to_a_service_with_a_slow_pace_wait_for_each_other(
    db: Database, clock: ManualClock
) -> None:
    service = InMemoryService()
    hour_s = 3600.0
    async with sending(db, service, clock, pace=Pace(hour_s, clock=clock)):
        await report(db, "a")
        async with asyncio.timeout(60):
            while not service.calls:
                await traces(db)

        await report(db, "b")
        await report(db, "c")
        clock.advance(timedelta(seconds=hour_s))
        async with asyncio.timeout(60):
            while len(service.calls) < 2:
                await traces(db)

    path, body = service.calls[1]
    assert path == "/reports/many"
    assert [each["report"]["text"] for each in body["reports"]] == ["b", "c"]


async def test_one_report_travels_alone(db: Database, clock: ManualClock) -> None:
    service = InMemoryService()
    await report(db, "a")

    async with sending(db, service, clock):
        await until_sent(db, clock)

    assert service.calls == [("/reports", {"text": "a"})]


async def test_reports_for_other_paths_stay_apart(db: Database, clock: ManualClock) -> None:
    service = InMemoryService()
    await report(db, "a", "b", path="/cancellations")

    async with sending(db, service, clock):
        await until_sent(db, clock)

    assert sorted(service.calls, key=str) == [
        ("/cancellations", {"text": "a"}),
        ("/cancellations", {"text": "b"}),
    ]


@pytest.mark.databases("sqlite")
@pytest.mark.parametrize(
    "refusal",
    [
        ServiceUnavailable("gateway", "down"),
        *(RemoteProblem(status, {"title": "no"}) for status in (404, 409, 413, 422)),
    ],
)
async def test_reports_of_a_refused_batch_are_sent_again_one_by_one(
    db: Database, clock: ManualClock, refusal: Exception
) -> None:
    service = InMemoryService(refusal)
    await report(db, "a", "b")

    async with sending(db, service, clock):
        await until_sent(db, clock)

    assert [path for path, _ in service.calls] == ["/reports/many", "/reports", "/reports"]
    assert sorted(body["text"] for _, body in service.calls[1:]) == ["a", "b"]


@pytest.mark.parametrize(
    ("attempts", "paths"),
    [(0, ["/reports/many"]), (1, ["/reports", "/reports"]), (2, ["/reports/many"])],
)
async def test_reports_travel_alone_in_every_second_try(
    db: Database, clock: ManualClock, attempts: int, paths: list[str]
) -> None:
    service = InMemoryService()
    sender = ReportSender(db, {"gateway": service}, clock, together=TOGETHER)
    rows = [make_row("/reports", attempts=attempts) for _ in range(2)]

    await asyncio.gather(*(sender._post(row) for row in rows))

    assert [path for path, _ in service.calls] == paths


@pytest.mark.parametrize(
    ("refusal", "longest_s"),
    [
        (RemoteProblem(409, {"code": "NOT_YET"}), 30.0),
        (ServiceUnavailable("gateway", "away"), 10.0),
    ],
    ids=["refused for now", "not answered"],
)
async def test_the_pause_of_a_report_grows_with_each_try(
    db: Database, clock: ManualClock, refusal: Exception, longest_s: float
) -> None:
    service = InMemoryService()
    service.alone = [refusal] * 12
    sender = ReportSender(db, {"gateway": service}, clock)
    pauses = []
    for attempts in range(12):
        retry = await sender._post(make_row("/a", attempts=attempts))
        assert retry is not None
        pauses.append(retry.after_s)

    assert pauses == [min(0.2 * 2**number, longest_s) for number in range(12)]


async def test_a_report_that_does_not_fit_travels_in_another_request(
    db: Database, clock: ManualClock
) -> None:
    service = InMemoryService()
    large = "x" * 100_000
    await report(db, "a" + large, "b" + large, "c")

    async with sending(db, service, clock):
        await until_sent(db, clock)

    bulks = [body["reports"] if path == "/reports/many" else [body] for path, body in service.calls]
    assert sorted(len(reports) for reports in bulks) == [1, 2]
    assert sum(len(reports) for reports in bulks) == 3
