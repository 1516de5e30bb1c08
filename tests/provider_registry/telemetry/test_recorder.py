"""Samples are stored once and in batches, and delay nothing."""

import asyncio
from collections.abc import AsyncIterator
from datetime import timedelta
from typing import Any

import pytest
from skyway_provider_registry.presence.follow import PresenceFollower
from skyway_provider_registry.telemetry.keep_telemetry import BATCH, TelemetryRecorder

from skyway.contracts.topics import TELEMETRY
from skyway.ids import DroneId
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.metrics import COUNTERS
from skyway.runtime.mqtt.client import Received
from skyway.runtime.sql.database import Database


def dropped(reason: str) -> float:
    return COUNTERS.value("skyway_telemetry_dropped", reason=reason)


async def test_samples_from_the_broker_are_stored(
    history: Any, db: Database, clock: ManualClock, make_sample: Any
) -> None:
    ids = (history.provider_id, history.drone_id)
    own = [Received(TELEMETRY, ids, make_sample(later_s, seq=later_s), False) for later_s in (1, 2)]
    foreign = Received(TELEMETRY, ("prv_other", history.drone_id), make_sample(9), False)

    async def batches() -> AsyncIterator[list[Received[Any]]]:
        yield [*own, foreign]

    recorder = TelemetryRecorder(db, clock)
    await PresenceFollower(batches(), db=db, clock=clock, listener=recorder.accept).step()
    await recorder.step()

    assert await history.shows() == [
        {
            "at": f"2026-03-01T12:00:0{second}Z",
            "position": [-98.0, 29.5],
            "soc": 0.5,
            "power_w": 600.0,
            "speed_mps": 23.0,
            "voltage_v": 22.1,
            "temperature_c": None,
            "range_m": None,
            "spread": None,
        }
        for second in (1, 2)
    ]


async def test_replicas_store_a_sample_once(
    history: Any, db: Database, clock: ManualClock, make_sample: Any
) -> None:
    received = [(DroneId(history.drone_id), make_sample(later_s)) for later_s in range(50)]
    replicas = [TelemetryRecorder(db, clock) for _ in range(2)]
    replicas[0].accept(received)
    replicas[1].accept(reversed(received))

    await asyncio.gather(*(replica.step() for replica in replicas))

    assert len(await history.shows()) == len(received)


async def test_samples_are_written_a_batch_at_a_time(
    history: Any, db: Database, clock: ManualClock, make_sample: Any
) -> None:
    recorder = TelemetryRecorder(db, clock)
    recorder.accept((DroneId(history.drone_id), make_sample(one)) for one in range(2 * BATCH + 1))

    has_more = [await recorder.step() for _ in range(4)]

    assert has_more == [True, False, False, False]
    assert len(await history.shows("limit=2000")) == 2 * BATCH + 1


async def test_a_full_batch_is_written_immediately(
    history: Any, db: Database, clock: ManualClock, make_sample: Any
) -> None:
    recorder = TelemetryRecorder(db, clock)
    recorder.accept((DroneId(history.drone_id), make_sample(one)) for one in range(BATCH))

    async with asyncio.timeout(60):
        await recorder.wake.wait(timeout_s=3600)


async def test_the_oldest_are_dropped_while_nothing_can_be_written(
    history: Any, migrated_url: str, clock: ManualClock, make_sample: Any
) -> None:
    late = Database(migrated_url)
    recorder = TelemetryRecorder(late, clock, most_waiting=3)
    before = dropped("database")
    for second in range(5):
        recorder.accept([(DroneId(history.drone_id), make_sample(second))])

    with pytest.raises(ServiceUnavailable):
        await recorder.step()
    async with late:
        await recorder.step()

    assert dropped("database") == before + 2
    assert await history.moments() == [f"2026-03-01T12:00:0{second}Z" for second in (2, 3, 4)]


async def test_a_batch_that_could_not_be_written_is_written_later(
    history: Any, migrated_url: str, clock: ManualClock, make_sample: Any
) -> None:
    late = Database(migrated_url)
    recorder = TelemetryRecorder(late, clock)
    recorder.accept([(DroneId(history.drone_id), make_sample(1))])

    with pytest.raises(ServiceUnavailable):
        await recorder.step()
    recorder.accept([(DroneId(history.drone_id), make_sample(2))])
    async with late:
        while await history.moments() != ["2026-03-01T12:00:01Z", "2026-03-01T12:00:02Z"]:
            await recorder.step()


@pytest.mark.parametrize("off", [timedelta(hours=2), timedelta(hours=-2), timedelta(days=-20_000)])
async def test_a_sample_with_a_wrong_clock_is_not_stored(
    history: Any, db: Database, clock: ManualClock, make_sample: Any, off: timedelta
) -> None:
    recorder = TelemetryRecorder(db, clock)
    before = dropped("clock")

    recorder.accept([(DroneId(history.drone_id), make_sample(off.total_seconds()))])
    await recorder.step()

    assert (await history.shows(), dropped("clock")) == ([], before + 1)
