"""Judges the messages of a batch: a drone that jumps is taken out of service, with an alarm."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Final

from pydantic import ValidationError

from skyway.contracts.drone_report import DroneState, Telemetry
from skyway.contracts.drones import DroneAlarm
from skyway.contracts.topics import Topic
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import DroneId, DroneModelId, ProviderId, StationId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.metrics import count
from skyway.runtime.mqtt.inbox import Arrival
from skyway.runtime.sql.database import Database
from skyway_provider_registry.presence import jump_store
from skyway_provider_registry.presence.jump import (
    Ahead,
    LastSeen,
    ahead_at,
    why_jumped,
    why_not_there,
)
from skyway_provider_registry.presence.learned_store import EndedStep
from skyway_provider_registry.presence.sighting_store import Sighting
from skyway_provider_registry.presence.wear import Wear, wear_between

#: How much longer one state may be on its way than the next, fleet and wall seconds. Our own
#: choice: the broker gives up a client that is silent for 15 s.
_ON_ITS_WAY_S: Final = (30.0, 30.0)

#: The activities whose end shows something about the drone.
_LEARNED_FROM: Final = ("FLYING", "RECHARGING")

#: Where a station is; None if that is not known.
StationPlace = Callable[[StationId], Position | None]


def nowhere_known(_station_id: StationId) -> Position | None:
    """No place: no network is known."""
    return None


@dataclass(frozen=True, slots=True)
class Judgement:
    """The drones that jumped, each with an alarm; of the others how much they are ahead.

    `ended` are those that have ended a flight or a recharge; `wear` is what they have flown.
    """

    alarms: list[DroneAlarm] = field(default_factory=list)
    ahead: dict[DroneId, Ahead] = field(default_factory=dict)
    ended: dict[DroneId, EndedStep] = field(default_factory=dict)
    wear: dict[DroneId, Wear] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class StateJudge:
    """Compares states and samples with the state before; the models of drones do not change."""

    db: Database
    clock: FleetClock
    place_of: StationPlace
    models: dict[DroneModelId, DroneModel] = field(default_factory=dict)

    async def judgement_on(
        self, sightings: Mapping[DroneId, Sighting], owners: Mapping[DroneId, ProviderId]
    ) -> Judgement:
        """What to think of the newest messages of some drones."""
        moving = [key for key, each in sightings.items() if each.state or each.sample]
        judgement = Judgement()
        if not moving:
            return judgement
        async with self.db.read() as connection:
            before = await jump_store.last_seen(connection, moving, self.models)
        now = self.clock.now()
        for drone_id, last in sorted(before.items()):
            sighting = sightings[drone_id]
            found = next(self._faults(last, sighting, now), None)
            if found is not None:
                reason, message = found
                judgement.alarms.append(_alarm(owners[drone_id], drone_id, reason, message, now))
            elif sighting.state is not None:
                judgement.ahead[drone_id] = ahead_at(last, sighting.state, received_at=now)
                worn = wear_between(last, sighting.state, received_at=now)
                if worn != Wear():
                    judgement.wear[drone_id] = worn
                step = _ended_step(last, sighting.state)
                if step is not None:
                    judgement.ended[drone_id] = step
        return judgement

    def _faults(
        self, last: LastSeen, sighting: Sighting, now: datetime
    ) -> Iterator[tuple[str, DroneState | Telemetry]]:
        """The messages that cannot follow the last state, each with the reason."""
        margin = fleet_margin(self.clock, fleet_s=_ON_ITS_WAY_S[0], wall_s=_ON_ITS_WAY_S[1])
        state, sample = sighting.state, sighting.sample
        if state is not None and (state.session, state.seq) > (last.session, last.seq):
            place = None if state.station_id is None else self.place_of(state.station_id)
            jumped = why_jumped(last, state, received_at=now, margin=margin)
            reason = jumped or why_not_there(state, place)
            if reason is not None:
                yield reason, state
        if sample is not None and _is_newer(sample, last):
            reason = why_jumped(last, sample, received_at=now, margin=margin)
            if reason is not None:
                yield reason, sample


def _ended_step(last: LastSeen, state: DroneState) -> EndedStep | None:
    """The flight or the recharge that this state ends; None if it ends none."""
    is_newer = (state.session, state.seq) > (last.session, last.seq)
    if not is_newer or last.activity not in _LEARNED_FROM or state.activity == last.activity:
        return None
    return EndedStep(before=last.activity, mission_id=last.mission_id, state=state)


def _is_newer(sample: Telemetry, last: LastSeen) -> bool:
    """Whether a sample is not an old one that comes again; its signature would be genuine."""
    return sample.session >= last.session and (sample.session, sample.seq) > last.sample_order


def _alarm(
    provider_id: ProviderId,
    drone_id: DroneId,
    reason: str,
    message: DroneState | Telemetry,
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
        data={"position": [*message.position], "soc": message.soc},
    )


def _any_drone(_drone_id: str) -> bool:
    return True


@dataclass(frozen=True, slots=True)
class NoQuarantine:
    """The `Reception` of the registry; the inbox and the check count what is dropped."""

    #: Whether this replica reads the messages of a drone.
    owns: Callable[[str], bool] = _any_drone

    def is_ours(self, ids: tuple[str, ...]) -> bool:
        """Whether this replica owns the drone; another replica reads the others' messages."""
        return self.owns(ids[1])

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
