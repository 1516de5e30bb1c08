"""What remembering telemetry costs the registry: processor time and bytes of each sample.

``python -m skyway_lab telemetry_history [--database postgresql://...]``: an empty database; without
one, a SQLite file that is removed again.
"""

import argparse
import asyncio
import random
import tempfile
import time
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any, Final

from skyway_provider_registry.presence import sighting_store as sightings
from skyway_provider_registry.presence.follow import PresenceFollower
from skyway_provider_registry.tables import drones, providers
from skyway_provider_registry.telemetry.keep_telemetry import KeepTimes, TelemetryRecorder, Thinning
from sqlalchemy import text

from skyway.contracts.drone_report import Telemetry
from skyway.contracts.topics import TELEMETRY
from skyway.geo import Position
from skyway.ids import DroneId
from skyway.runtime.clock import ManualClock
from skyway.runtime.minting import mint
from skyway.runtime.mqtt.inbox import Inbox, Received
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.migrations import migrate

DRONES: Final = 1_000
ROUNDS: Final = 60
SEED: Final = 7
#: Fleet seconds between two samples of a drone, and messages that the registry writes in one batch.
EVERY_S: Final = 5.0
BATCH: Final = 250

_TABLES: Final = ("telemetry_samples", "telemetry_minutes")
_SIZES: Final = {
    "sqlite": "SELECT sum(pgsize) FROM dbstat WHERE name = '{}'",
    "postgresql": "SELECT pg_total_relation_size('{}')",
}


@dataclass
class Registry:
    """The part of the registry that remembers, with a fleet of one provider."""

    db: Database
    clock: ManualClock
    drone_ids: Sequence[DroneId]
    seq: int = 0

    def __post_init__(self) -> None:
        self.inbox = Inbox((TELEMETRY,))
        self.recorder = TelemetryRecorder(self.db, self.clock)
        batches: AsyncIterator[list[Received[Any]]] = self.inbox.batches()
        self.follower = PresenceFollower(
            batches, db=self.db, clock=self.clock, listener=self.recorder.accept
        )
        self.chance = random.Random(SEED)

    def message(self) -> bytes:
        """A sample of now, as a drone sends it."""
        at = self.clock.now() + timedelta(milliseconds=self.chance.randrange(4_000))
        one = self.chance.random
        sample = Telemetry(
            message_id=mint("msg"),
            sent_at=at,
            at=at,
            session=1,
            seq=self.seq,
            position=Position(-98 + one(), 29 + one()),
            soc=one(),
            power_w=600 * one(),
            speed_mps=23 * one(),
            voltage_v=22 * one(),
            temperature_c=31 * one(),
            range_m=4_000 * one(),
        )
        return sample.model_dump_json().encode()

    async def receive_all(self) -> float:
        """One sample of each drone, kept; the processor seconds it took."""
        self.clock.advance(timedelta(seconds=EVERY_S))
        self.seq += 1
        used_s = 0.0
        for start in range(0, len(self.drone_ids), BATCH):
            for drone_id in self.drone_ids[start : start + BATCH]:
                self.inbox.offer(TELEMETRY("p", drone_id).name, self.message(), retained=False)
            began_s = time.process_time()
            await self.follower.step()
            used_s += time.process_time() - began_s
        began_s = time.process_time()
        while await self.recorder.step():
            pass
        return used_s + time.process_time() - began_s

    async def thin_all(self) -> float:
        """All samples made minutes; the processor seconds it took."""
        self.clock.advance(timedelta(hours=25))
        keeping = KeepTimes(samples_for=timedelta(hours=24), minutes_for=timedelta(days=30))
        thinning = Thinning(self.db, self.clock, keeping, pause_s=0.0)
        began_s = time.process_time()
        while await thinning.step():
            pass
        return time.process_time() - began_s

    async def bytes_each(self, table: str) -> float:
        """The bytes of a row with its share of the keys."""
        async with self.db.read() as connection:
            size = (await connection.execute(text(_SIZES[self.db.dialect].format(table)))).scalar()
            rows = await connection.execute(text(f"SELECT count(*) FROM {table}"))
            return float(size or 0) / float(rows.scalar_one())


async def registered(db: Database, clock: ManualClock) -> Registry:
    """The registry of a new database."""
    ids = [DroneId(mint("drn")) for _ in range(DRONES)]
    provider = {"provider_id": "p", "name": "p", "tariff": "{}", "state": "ACTIVE", "created_ms": 0}
    home = {
        "network_id": "n",
        "home_station_id": "s",
        "home_longitude_deg": 0.0,
        "home_latitude_deg": 0.0,
    }
    rest = {"model_id": "m", "initial_soc": 1.0, "is_in_maintenance": False, "created_ms": 0}
    async with db.write() as tx:
        await tx.execute(providers.insert(), provider)
        rows = [{"drone_id": each, "provider_id": "p", **home, **rest} for each in ids]
        await tx.execute(drones.insert(), rows)
        await sightings.begin(tx, ids, change=0)
    return Registry(db, clock, ids)


async def measure(url: str) -> None:
    """Print what a sample costs on this database."""
    await migrate(url, "skyway_provider_registry")
    async with Database(url) as db:
        registry = await registered(db, ManualClock(datetime(2026, 3, 1, 12, tzinfo=UTC)))
        used_s = sum([await registry.receive_all() for _ in range(ROUNDS)])
        samples = DRONES * ROUNDS
        print(f"{db.dialect}: {samples} samples of {DRONES} drones, one each {EVERY_S:g} s")
        print(f"  received and stored: {used_s / samples * 1e6:.0f} us a sample")
        print(f"  {_TABLES[0]}: {await registry.bytes_each(_TABLES[0]):.0f} bytes a row")
        print(f"  thinned: {await registry.thin_all() / samples * 1e6:.0f} us a sample")
        print(f"  {_TABLES[1]}: {await registry.bytes_each(_TABLES[1]):.0f} bytes a row")


def main() -> None:
    """Measure the database that is named, or a SQLite file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--database", help="the URL of an empty database")
    url = parser.parse_args().database
    with tempfile.TemporaryDirectory() as folder:
        asyncio.run(measure(url or f"sqlite:///{folder}/registry.db"))


if __name__ == "__main__":
    main()
