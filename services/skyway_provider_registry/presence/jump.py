"""Whether a drone can have come from its last state to its next: by flight, and by charging.

A drone may say where it is, and who believes it sends it packages. A drone that jumps is not
believed until a person has looked.
"""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.drone_report import DroneState
from skyway.drone.model import DroneModel
from skyway.geo import Position, distance_m

#: The strongest tailwind with which a drone is believed to fly, metres per second, as composition
#: believes it. Our own choice.
_TAILWIND_MPS: Final = 25.0

#: How far a receiver of satellites may be wrong, and by how much an estimate of the charge. Our own
#: choice.
_POSITION_ERROR_M: Final = 500.0
_CHARGE_ERROR: Final = 0.1


@dataclass(frozen=True, slots=True)
class LastSeen:
    """The last state of a drone, and when it was received in fleet time.

    The drone's own moments do not count: it could say that its last state is an hour old.
    """

    session: int
    seq: int
    received_at: datetime
    position: Position
    soc: float
    model: DroneModel


def why_jumped(
    before: LastSeen, state: DroneState, *, received_at: datetime, margin: timedelta
) -> str | None:
    """Why this state cannot follow; None if it can.

    `margin` is how much longer the last state may have been on its way than this one.
    """
    passed = max(timedelta(0), received_at - before.received_at) + margin
    return _too_far(before, state, passed) or _too_full(before, state, passed)


def _too_far(before: LastSeen, state: DroneState, passed: timedelta) -> str | None:
    fastest_mps = before.model.speed_empty_mps + _TAILWIND_MPS
    possible_m = fastest_mps * passed.total_seconds() + _POSITION_ERROR_M
    length_m = distance_m(before.position, state.position)
    if length_m <= possible_m:
        return None
    return (
        f"it was {length_m:.0f} m away {passed.total_seconds():.0f} s before, and flies at most "
        f"{possible_m:.0f} m in this time"
    )


def _too_full(before: LastSeen, state: DroneState, passed: timedelta) -> str | None:
    """Whether it charged too fast; after a restart it may have another battery."""
    if state.session != before.session:
        return None
    times_s, socs = before.model.charge_columns
    fastest_per_s = (socs[1] - socs[0]) / (times_s[1] - times_s[0])
    possible = before.soc + fastest_per_s * passed.total_seconds() + _CHARGE_ERROR
    if state.soc <= possible:
        return None
    return (
        f"its charge rose from {before.soc:.2f} to {state.soc:.2f} within "
        f"{passed.total_seconds():.0f} s, and can rise to {possible:.2f} at most"
    )
