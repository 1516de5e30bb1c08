"""Samples as drones send them, and the registry's answers about them."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import pytest
from skyway_provider_registry.telemetry import store
from skyway_provider_registry.telemetry.store import ReceivedSample

from skyway.contracts.drone_report import Telemetry
from skyway.geo import Position
from skyway.ids import DroneId
from skyway.runtime.clock import ManualClock
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms

MakeSample = Callable[..., Telemetry]


@pytest.fixture
def make_sample(clock: ManualClock) -> MakeSample:
    """A sample of now, or of some seconds later."""

    def make(later_s: float = 0.0, **members: Any) -> Telemetry:
        at = clock.now() + timedelta(seconds=later_s)
        given = {"session": 7, "seq": 1, "position": Position(-98.0, 29.5), "soc": 0.5}
        measured = {"power_w": 600.0, "speed_mps": 23.0, "voltage_v": 22.1}
        return Telemetry.model_validate(
            {"message_id": "m", "sent_at": at, "at": at, **given, **measured, **members}
        )

    return make


@dataclass
class History:
    """One drone, what is kept of it, and what is shown."""

    api: Any
    db: Database
    clock: ManualClock
    provider_id: str
    drone_id: str

    @property
    def path(self) -> str:
        return f"/v1/providers/{self.provider_id}/drones/{self.drone_id}/telemetry"

    async def keeps(self, *samples: Telemetry) -> None:
        wall_ms = moment_to_ms(self.clock.wall_now())
        received = [ReceivedSample(DroneId(self.drone_id), sample, wall_ms) for sample in samples]
        async with self.db.write() as tx:
            await store.add(tx, received)

    async def asks(self, query: str = "") -> Any:
        answer = await self.api(f"provider:{self.provider_id}", "GET", f"{self.path}?{query}")
        assert answer.status_code == 200, answer.text
        return answer.json()

    async def shows(self, query: str = "") -> list[dict[str, Any]]:
        items: list[dict[str, Any]] = (await self.asks(query))["items"]
        return items

    async def moments(self, query: str = "") -> list[str]:
        return [item["at"] for item in await self.shows(query)]


@pytest.fixture
async def history(api: Any, db: Database, clock: ManualClock) -> History:
    provider_id = await api.provider()
    drone_id = (await api.drone(provider_id))["drone_id"]
    return History(api, db, clock, provider_id, drone_id)
