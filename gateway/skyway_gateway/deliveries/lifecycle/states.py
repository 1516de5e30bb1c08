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

#: A delivery in these has, or had, a mission.
UNDER_WAY_STATES: Final[frozenset[DeliveryState]] = frozenset(
    {"PLANNED", "DISPATCHED", "LOADING", "IN_PROGRESS"}
)

#: A delivery is over once all its packages are in these.
SETTLED_PACKAGE_STATES: Final[frozenset[PackageState]] = frozenset(
    {"DELIVERED", "RETURNED", "STRANDED", "CANCELLED"}
)

#: A package in these is on a drone.
ON_BOARD_STATES: Final[frozenset[PackageState]] = frozenset({"LOADED", "IN_TRANSIT", "RETURNING"})

#: A report may skip states: a drone that is loaded at once was never seen loading. A request of
#: which no package is ever booked is rejected; one whose packages are all cancelled, CANCELLED.
_NEXT: Final[Mapping[DeliveryState, frozenset[DeliveryState]]] = {
    "REQUESTED": frozenset({"PLANNED", "REJECTED", "CANCELLED", "FAILED"}),
    "PLANNED": _ENDS | {"REQUESTED", "DISPATCHED", "LOADING", "IN_PROGRESS"},
    # Back, when of several missions the one that was furthest along is refused.
    "DISPATCHED": _ENDS | {"REQUESTED", "PLANNED", "LOADING", "IN_PROGRESS"},
    "LOADING": _ENDS | {"IN_PROGRESS"},
    "IN_PROGRESS": _ENDS,
}


def may_follow(after: DeliveryState, before: DeliveryState) -> bool:
    """Whether a delivery in state `before` may come to be in state `after`, or stay in it."""
    return after == before or after in _NEXT.get(before, ())
