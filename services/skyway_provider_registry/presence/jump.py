"""Whether a drone can have come from its last state to its next: by flight, and by charging.

A drone may say where it is, and who believes it sends it packages. A drone that jumps is not
believed until a person has looked.

Messages come late, and measurements are wrong by a little, so each drone may be somewhat ahead of
what it can fly and charge. This is one allowance for all its states: what a drone is ahead stays
with it until time has made up for it. So many small jumps count like a large one.
"""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.drone_report import DroneState, Telemetry
from skyway.drone.model import DroneModel
from skyway.geo import Position, distance_m
from skyway.ids import MissionId

#: The strongest tailwind with which a drone is believed to fly, metres per second, as composition
#: believes it. Our own choice.
_TAILWIND_MPS: Final = 25.0

#: How far a receiver of satellites may be wrong, and by how much an estimate of the charge. Our own
#: choice.
_POSITION_ERROR_M: Final = 500.0
_CHARGE_ERROR: Final = 0.1


@dataclass(frozen=True, slots=True)
class Ahead:
    """How much further a drone has come, and how much fuller, than it can fly and charge."""

    length_m: float = 0.0
    soc: float = 0.0


@dataclass(frozen=True, slots=True)
class LastSeen:
    """The last state of a drone, and when it was received in fleet time.

    `sample_order` is the session and the `seq` of its last sample.
    The drone's own moments do not count: it could say that its last state is an hour old.
    """

    session: int
    seq: int
    sample_order: tuple[int, int]
    received_at: datetime
    position: Position
    soc: float
    ahead: Ahead
    model: DroneModel
    activity: str
    mission_id: MissionId | None = None
    #: Whether the drone has another battery since then, with a charge of its own.
    has_other_battery: bool = False

    @property
    def fastest_mps(self) -> float:
        """How fast the drone flies at most."""
        return self.model.speed_empty_mps + _TAILWIND_MPS

    @property
    def charging_per_s(self) -> float:
        """How much its state of charge rises in a second at most."""
        times_s, socs = self.model.charge_columns
        return float((socs[1] - socs[0]) / (times_s[1] - times_s[0]))

    def passed_s(self, now: datetime) -> float:
        """The seconds since the state was received."""
        return max(0.0, (now - self.received_at).total_seconds())


def ahead_at(before: LastSeen, after: DroneState | Telemetry, *, received_at: datetime) -> Ahead:
    """How much the drone is ahead with this message, its earlier lead included."""
    passed_s = before.passed_s(received_at)
    flown_m = distance_m(before.position, after.position)
    ahead = Ahead(
        max(0.0, before.ahead.length_m + flown_m - before.fastest_mps * passed_s),
        max(0.0, before.ahead.soc + after.soc - before.soc - before.charging_per_s * passed_s),
    )
    return Ahead(ahead.length_m) if before.has_other_battery else ahead


def why_jumped(
    before: LastSeen, after: DroneState | Telemetry, *, received_at: datetime, margin: timedelta
) -> str | None:
    """Why this message cannot follow; None if it can.

    `margin` is how much longer the last state may have been on its way than this message.
    """
    ahead = ahead_at(before, after, received_at=received_at)
    passed_s, margin_s = before.passed_s(received_at), margin.total_seconds()
    if ahead.length_m > before.fastest_mps * margin_s + _POSITION_ERROR_M:
        return (
            f"it was {distance_m(before.position, after.position):.0f} m away {passed_s:.0f} s "
            f"before, and is {ahead.length_m:.0f} m further than it can fly"
        )
    if ahead.soc > before.charging_per_s * margin_s + _CHARGE_ERROR:
        return (
            f"its charge rose from {before.soc:.2f} to {after.soc:.2f} within {passed_s:.0f} s, "
            f"and is {ahead.soc:.2f} more than it can charge"
        )
    return None


def why_not_there(state: DroneState, station: Position | None) -> str | None:
    """Why a drone on the ground cannot stand at the station that it names; None if it can.

    `station` is where this station is, if that is known.
    """
    if station is None or state.activity in ("FLYING", "DOWN"):
        return None
    length_m = distance_m(station, state.position)
    if length_m <= _POSITION_ERROR_M:
        return None
    return f"it says that it stands at {state.station_id}, and is {length_m:.0f} m away from it"
