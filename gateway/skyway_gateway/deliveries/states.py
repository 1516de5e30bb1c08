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

#: A report may skip states: a drone that is loaded at once was never seen loading.
_NEXT: Final[Mapping[DeliveryState, frozenset[DeliveryState]]] = {
    "REQUESTED": frozenset({"PLANNED", "REJECTED", "CANCELLED", "FAILED"}),
    "PLANNED": _ENDS | {"REQUESTED", "DISPATCHED", "LOADING", "IN_PROGRESS"},
    "DISPATCHED": _ENDS | {"REQUESTED", "LOADING", "IN_PROGRESS"},
    "LOADING": _ENDS | {"IN_PROGRESS"},
    "IN_PROGRESS": _ENDS,
}


def may_follow(after: DeliveryState, before: DeliveryState) -> bool:
    """Whether a delivery in state `before` may come to be in state `after`, or stay in it."""
    return after == before or after in _NEXT.get(before, ())
