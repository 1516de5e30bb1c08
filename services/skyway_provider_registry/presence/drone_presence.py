"""What is known of a drone from its own messages and from composition's mission reports."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Literal

from skyway.contracts.drone_health import ActiveFailsafe, DroneHealth, Fault
from skyway.contracts.drone_report import DroneState
from skyway.contracts.mission import MissionState
from skyway.geo import Position
from skyway.ids import MissionId, StationId
from skyway.json_model import WireModel


class Condition(WireModel):
    """What a `state` message says of the drone's health, and of what it does by itself."""

    health: DroneHealth | None = None
    faults: tuple[Fault, ...] = ()
    failsafe: ActiveFailsafe | None = None


#: Of a drone that has not told of itself.
NOT_TOLD = Condition()


def condition_text(state: DroneState) -> str | None:
    """The JSON of a `Condition`; None when there is nothing to say."""
    if state.health is None and not state.faults and state.failsafe is None:
        return None
    told = Condition.model_construct(
        health=state.health, faults=state.faults, failsafe=state.failsafe
    )
    return told.model_dump_json(exclude_defaults=True)


def condition_of(text: str | None) -> Condition:
    """What `condition_text` made a text of."""
    return NOT_TOLD if text is None else Condition.read(text)


ConnectionStatus = Literal["ONLINE", "OFFLINE", "LOST"]
Activity = Literal["IDLE", "LOADING", "FLYING", "WAITING", "RECHARGING", "DELIVERING", "DOWN"]

#: Wall time without a word after which a drone is not believed to be online: three of the state
#: messages that are due every 30 s. A broker that was killed never sent the last wills.
SILENCE = timedelta(seconds=100)


@dataclass(frozen=True, slots=True)
class LastState:
    """The newest `state` message, as far as the registry needs it.

    `condition` is the JSON of its `Condition`: selection reads states, and never that.
    """

    session: int
    at: datetime
    activity: Activity
    station_id: StationId | None
    position: Position
    soc: float
    condition: str | None = None


@dataclass(frozen=True, slots=True)
class LastSample:
    """The newest `telemetry` message."""

    session: int
    at: datetime
    position: Position
    soc: float


@dataclass(frozen=True, slots=True)
class Presence:
    """All that is known of a drone now; None where nothing has been heard.

    `mission_id` is the mission it is said to be on, by itself or by composition;
    `mission_state` is composition's word on it.
    """

    connection: ConnectionStatus | None = None
    state: LastState | None = None
    sample: LastSample | None = None
    mission_id: MissionId | None = None
    mission_state: MissionState | None = None
    names_mission: bool = False
    last_seen_at: datetime | None = None
    last_seen_wall_at: datetime | None = None

    def is_online(self, wall_now: datetime) -> bool:
        """Whether the drone is connected and has been heard of lately."""
        if self.connection != "ONLINE" or self.last_seen_wall_at is None:
            return False
        return wall_now - self.last_seen_wall_at <= SILENCE

    @property
    def place(self) -> tuple[Position, float] | None:
        """Position and charge: the state's, or a later sample's while the drone moves or charges.

        Only samples of the state's own session are compared with it by their moments: two clocks
        of one drone must never decide what comes later.
        """
        if self.state is None:
            return None
        sample = self.sample
        is_changing = self.state.activity in ("FLYING", "RECHARGING")
        if (
            sample is not None
            and is_changing
            and sample.session == self.state.session
            and sample.at > self.state.at
        ):
            return sample.position, sample.soc
        return self.state.position, self.state.soc


#: A drone that has been registered and has not been heard of.
NEVER_SEEN = Presence()
