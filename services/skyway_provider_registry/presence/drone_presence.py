"""The presence of a drone, from its own messages and composition's mission reports."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Literal

from skyway.contracts.drone_report import ActiveFailsafe, DroneHealth, DroneState, Fault
from skyway.contracts.mission import MissionState
from skyway.geo import Position
from skyway.ids import MissionId, StationId
from skyway.json_model import WireModel


class Condition(WireModel):
    """The health, faults and active failsafe of a `state` message."""

    health: DroneHealth | None = None
    faults: tuple[Fault, ...] = ()
    failsafe: ActiveFailsafe | None = None


#: The condition of a drone without a `state` message.
NO_CONDITION = Condition()


def condition_text(state: DroneState) -> str | None:
    """The JSON of a `Condition`; None when it would be empty."""
    if state.health is None and not state.faults and state.failsafe is None:
        return None
    condition = Condition.model_construct(
        health=state.health, faults=state.faults, failsafe=state.failsafe
    )
    return condition.model_dump_json(exclude_defaults=True)


def condition_of(text: str | None) -> Condition:
    """The condition in a text that `condition_text` made."""
    return NO_CONDITION if text is None else Condition.read(text)


ConnectionStatus = Literal["ONLINE", "OFFLINE", "LOST"]
Activity = Literal["IDLE", "LOADING", "FLYING", "WAITING", "RECHARGING", "DELIVERING", "DOWN"]

#: A drone without a message for this long counts as offline, wall time: it has missed three of the
#: `state` messages that are due every 30 s. A killed broker sends no last wills.
SILENCE = timedelta(seconds=100)


@dataclass(frozen=True, slots=True)
class LastState:
    """The part of the newest `state` message that the registry needs.

    `condition` is the JSON of a `Condition`; selection reads many states and never needs it parsed.
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
    """The presence of a drone now; None where no message has been received.

    `mission_id` comes from the drone or from composition, `mission_state` from composition alone;
    `names_mission` is True when the drone's last `state` message names this mission too.
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
        """Whether the drone is connected and has sent a message lately."""
        if self.connection != "ONLINE" or self.last_seen_wall_at is None:
            return False
        return wall_now - self.last_seen_wall_at <= SILENCE

    @property
    def place(self) -> tuple[Position, float] | None:
        """Position and charge: of the state, or of a later sample while the drone moves or charges.

        A sample is compared with the state only within one session: a drone's clock may differ
        between two sessions.
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


#: The presence of a registered drone that has sent no message.
NEVER_SEEN = Presence()
