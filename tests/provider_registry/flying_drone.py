"""A drone that flies missions of composition, and what the registry makes of its states."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

from skyway_provider_registry.presence.follow import Recorder
from skyway_verifier.registry.rules import RULES

from skyway.contracts.candidate import Candidate
from skyway.contracts.drone_report import DroneHealth, DroneState
from skyway.contracts.shortlist import Candidates
from skyway.contracts.topics import CONNECTION, STATE
from skyway.drone.learned_values import LearnedValues
from skyway.runtime.clock import ManualClock
from skyway.runtime.mqtt.client import Received
from skyway.runtime.sql.database import Database
from tests.broken_rules import broken_rules


def make_health(
    *, use: float | None = None, health: float = 1.0, charging: float | None = None
) -> DroneHealth:
    return DroneHealth(
        voltage_v=22.0,
        current_a=1.0,
        soc_error=0.01,
        cell_spread_v=0.01,
        temperature_c=20.0,
        state_of_health=health,
        still_air_factor=use,
        charge_rate_factor=charging,
        range_m=10_000.0,
    )


@dataclass
class FlyingDrone:
    """A drone with a mission of composition, and what the registry learns from its states."""

    api: Any
    db: Database
    clock: ManualClock
    make: Callable[..., DroneState]
    drone: dict[str, Any]
    seq: int = 1
    reported: int = 0
    soc: float = 0.9
    mission_id: str = "msn_1"

    async def broken_rules(self) -> list[tuple[str, str]]:
        """What `verify` finds by the clock of the test."""
        wall_at, fleet_at = self.clock.wall_now(), self.clock.now()
        return await broken_rules(self.db, RULES, wall_at=wall_at, fleet_at=fleet_at)

    async def flies(
        self,
        health: DroneHealth,
        *,
        mission_id: str = "msn_1",
        seconds: float = 300,
        soc_after: float = 0.9,
    ) -> DroneState:
        """Take off and land; the state after the landing."""
        mission = {"mission_id": mission_id, "health": health}
        await self.does("FLYING", after_s=seconds / 2, soc=0.9, **mission)
        return await self.does("WAITING", after_s=seconds / 2, soc=soc_after, **mission)

    async def charges(self, *, soc_after: float) -> DroneState:
        """Charge on a pad for three hours, without measuring."""
        await self.does("RECHARGING", after_s=1.0, soc=self.soc)
        return await self.does("WAITING", after_s=3 * 3_600.0, soc=soc_after)

    async def rests(self, *, soc: float) -> DroneState:
        """Stand at home without a mission."""
        return await self.does("IDLE", after_s=1.0, soc=soc)

    async def does(self, activity: str, *, after_s: float, **members: Any) -> DroneState:
        """Send a state after some seconds."""
        self.seq += 1
        self.soc = members["soc"]
        self.clock.advance(timedelta(seconds=after_s))
        state = self.make(7, self.seq, activity=activity, **members)
        await self.sends(state)
        return state

    async def sends(self, state: DroneState) -> None:
        ids = (self.drone["provider_id"], self.drone["drone_id"])
        await Recorder(self.db, self.clock).record([Received(STATE, ids, state, False)])

    async def reports(self, kind: str, mission_state: str) -> None:
        """Composition reports about the mission of the drone."""
        self.reported += 1
        report = {
            "report_id": f"rpt_{self.reported}",
            "delivery_id": "dlv_1",
            "attempt": 1,
            "trip": 1,
            "mission_id": self.mission_id,
            "provider_id": self.drone["provider_id"],
            "drone_id": self.drone["drone_id"],
            "seq": self.reported,
            "kind": kind,
            "at": "2026-03-01T12:00:00Z",
            "mission_state": mission_state,
        }
        await self.api(None, "POST", "/internal/mission-reports", report, service="composition")

    async def call(self, method: str, path: str = "", body: Any = None) -> Any:
        """A call of the drone's provider about the drone."""
        return await self.provider_calls(method, f"/drones/{self.drone['drone_id']}{path}", body)

    async def provider_calls(self, method: str, path: str, body: Any = None) -> Any:
        """A call of the drone's provider about its own things."""
        own = f"/v1/providers/{self.drone['provider_id']}{path}"
        return await self.api(f"provider:{self.drone['provider_id']}", method, own, body)

    async def learned(self) -> Any:
        return (await self.call("GET")).json()["learned"]

    async def planned(self) -> LearnedValues:
        """What a request for candidates gets."""
        (candidate,) = await self.candidates()
        return candidate.learned

    async def candidates(self) -> Sequence[Candidate]:
        """The drones that a request gets."""
        query = {
            "pickup_station_id": "san-marcos",
            "pickup_position": [-97.9, 29.9],
            "payload_kg": 1.0,
            "providers": {},
        }
        answer = await self.api(None, "POST", "/internal/candidates", query, service="gateway")
        return Candidates.read(answer.content).shortlist.candidates


async def fly_drone(
    api: Any,
    db: Database,
    clock: ManualClock,
    make: Callable[..., DroneState],
    online: Any,
    *,
    mission_id: str = "msn_1",
) -> FlyingDrone:
    """A new drone that is online at home, and whose mission was accepted."""
    made = await api.drone(await api.provider())
    ids = (made["provider_id"], made["drone_id"])
    await Recorder(db, clock).record(
        [Received(CONNECTION, ids, online(7, 1), False), Received(STATE, ids, make(7, 1), False)]
    )
    flying = FlyingDrone(api, db, clock, make, made, mission_id=mission_id)
    await flying.reports("ACCEPTED", "ACCEPTED")
    return flying
