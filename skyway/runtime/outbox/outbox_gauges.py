"""The gauges of an outbox: how many messages wait on each channel, and since when."""

import time
from dataclasses import dataclass

from sqlalchemy import Table

from skyway.runtime.gauges import Gauge
from skyway.runtime.outbox.outbox_store import waiting_messages
from skyway.runtime.sql.database import Database


@dataclass(frozen=True, slots=True)
class OutboxGauges:
    """Reads the outbox of a database; the `channels` are shown even if nothing waits on them."""

    db: Database
    table: Table
    channels: tuple[str, ...]

    async def read(self) -> list[Gauge]:
        """How many messages wait on each channel, and the age of the oldest."""
        async with self.db.survey() as connection:
            found = {each.channel: each for each in await waiting_messages(connection, self.table)}
        readings = []
        for channel in self.channels:
            waiting = found.get(channel)
            oldest_wall_ms = None if waiting is None else waiting.oldest_wall_ms
            age_s = 0.0 if oldest_wall_ms is None else time.time() - oldest_wall_ms / 1000
            labels, messages = {"channel": channel}, 0 if waiting is None else waiting.messages
            about = "messages that are not sent, or not confirmed yet"
            readings += [
                Gauge("skyway_outbox_depth", about, messages, labels),
                Gauge(
                    "skyway_outbox_age_seconds",
                    "age of the oldest of them",
                    max(age_s, 0.0),
                    labels,
                ),
            ]
        return readings
