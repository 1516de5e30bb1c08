"""Judges the states of a batch: a drone that jumps is taken out of service, with an alarm.

Messages that are not from their drones are counted and dropped. Composition reads most of the same
messages, keeps them in its quarantine, and raises alarms.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Final

from pydantic import ValidationError

from skyway.contracts.drone_report import DroneState
from skyway.contracts.drones import DroneAlarm
from skyway.contracts.topics import Topic
from skyway.drone.model import DroneModel
from skyway.ids import DroneId, DroneModelId, ProviderId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.metrics import count
from skyway.runtime.mqtt.inbox import Arrival
from skyway.runtime.sql.database import Database
from skyway_provider_registry.presence import jump_store
from skyway_provider_registry.presence.jump import LastSeen, why_jumped

#: How much longer one state may be on its way than the next, fleet and wall seconds. Our own
#: choice: the broker gives up a client that is silent for 15 s.
_ON_ITS_WAY_S: Final = (30.0, 30.0)


@dataclass(frozen=True, slots=True)
class StateJudge:
    """Compares each state with the state before; the models of drones do not change."""

    db: Database
    clock: FleetClock
    models: dict[DroneModelId, DroneModel] = field(default_factory=dict)

    async def alarms_about(
        self, states: Mapping[DroneId, DroneState], owners: Mapping[DroneId, ProviderId]
    ) -> list[DroneAlarm]:
        """An alarm about each drone that jumped."""
        if not states:
            return []
        async with self.db.read() as connection:
            before = await jump_store.last_seen(connection, states.keys(), self.models)
        now = self.clock.now()
        return [
            self._alarm(owners[drone_id], drone_id, reason, states[drone_id], now)
            for drone_id, last in sorted(before.items())
            if (reason := self._why_jumped(last, states[drone_id], now)) is not None
        ]

    def _why_jumped(self, last: LastSeen, state: DroneState, now: datetime) -> str | None:
        if (state.session, state.seq) <= (last.session, last.seq):
            return None
        margin = fleet_margin(self.clock, fleet_s=_ON_ITS_WAY_S[0], wall_s=_ON_ITS_WAY_S[1])
        return why_jumped(last, state, received_at=now, margin=margin)

    def _alarm(
        self,
        provider_id: ProviderId,
        drone_id: DroneId,
        reason: str,
        state: DroneState,
        now: datetime,
    ) -> DroneAlarm:
        count("skyway_jumps", "drones that were taken out of service because they jumped")
        return DroneAlarm(
            provider_id=provider_id,
            drone_id=drone_id,
            level="URGENT",
            code="DRONE_JUMPED",
            detail=f"{reason}; the drone is in MAINTENANCE until a person has looked",
            at=now,
            data={"position": [*state.position], "soc": state.soc},
        )


class NoQuarantine:
    """The `Reception` of the registry; the inbox and the check count what is dropped."""

    def is_shut_out(self, ids: tuple[str, ...]) -> bool:
        """Never."""
        del ids
        return False

    def unreadable(
        self, topic: Topic[Any], ids: tuple[str, ...], payload: bytes, error: ValidationError
    ) -> None:
        """Drop it."""

    def forged(self, arrival: Arrival) -> None:
        """Drop it."""

    def postponed(self, ids: tuple[str, ...]) -> None:
        """Do nothing: the registry concludes nothing from silence within seconds."""
