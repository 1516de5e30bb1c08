"""The states of a delivery, and which may follow which: terminal states are final."""

from collections.abc import Mapping
from typing import Final, Literal

DeliveryState = Literal[
    "REQUESTED",
    "PLANNED",
    "DISPATCHED",
    "LOADING",
    "IN_PROGRESS",
    "COMPLETED",
    "PARTIALLY_COMPLETED",
    "CANCELLED",
    "FAILED",
    "REJECTED",
]

PackageState = Literal[
    "CREATED",
    "LOADED",
    "IN_TRANSIT",
    "DELIVERED",
    "RETURNING",
    "RETURNED",
    "STRANDED",
    "CANCELLED",
]

_ENDS: Final[frozenset[DeliveryState]] = frozenset(
    {"COMPLETED", "PARTIALLY_COMPLETED", "CANCELLED", "FAILED"}
)

TERMINAL_STATES: Final[frozenset[DeliveryState]] = _ENDS | {"REJECTED"}

#: A delivery in these states has, or had, a mission.
UNDER_WAY_STATES: Final[frozenset[DeliveryState]] = frozenset(
    {"PLANNED", "DISPATCHED", "LOADING", "IN_PROGRESS"}
)

#: A delivery is over when all its packages are in these states.
SETTLED_PACKAGE_STATES: Final[frozenset[PackageState]] = frozenset(
    {"DELIVERED", "RETURNED", "STRANDED", "CANCELLED"}
)

#: A package in these states is on a drone.
ON_BOARD_STATES: Final[frozenset[PackageState]] = frozenset({"LOADED", "IN_TRANSIT", "RETURNING"})

#: Which states may follow each state. A report may skip states, such as LOADING when the drone
#: loads within one report. A request is REJECTED when none of its packages is ever booked.
_NEXT: Final[Mapping[DeliveryState, frozenset[DeliveryState]]] = {
    "REQUESTED": frozenset({"PLANNED", "REJECTED", "CANCELLED", "FAILED"}),
    "PLANNED": _ENDS | {"REQUESTED", "DISPATCHED", "LOADING", "IN_PROGRESS"},
    # A delivery goes back when a drone refuses the mission that was furthest along.
    "DISPATCHED": _ENDS | {"REQUESTED", "PLANNED", "LOADING", "IN_PROGRESS"},
    "LOADING": _ENDS | {"IN_PROGRESS"},
    "IN_PROGRESS": _ENDS,
}


def may_follow(after: DeliveryState, before: DeliveryState) -> bool:
    """Whether a delivery in state `before` may change to state `after`, or stay in it."""
    return after == before or after in _NEXT.get(before, ())
