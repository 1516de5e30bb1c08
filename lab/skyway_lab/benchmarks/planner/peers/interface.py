"""The tasks that peers solve. A peer's module has one class; `package` is its name on PyPI."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt


class OrderPeer(Protocol):
    """Orders the destinations, so that flying to all of them takes least time."""

    package: str

    def order(self, flight_ms: npt.NDArray[np.int64]) -> list[int]:
        """The destinations, 1 to k, in the order to visit them.

        `flight_ms` is ``(k + 1, k + 1)``, row = from; 0 is the source, and no drone has to
        return to it.
        """


@dataclass(frozen=True, slots=True)
class ChargingTask:
    """Stops in order, stations to charge at, one load, and all pads free.

    `seconds` and `joules` are ``(n, n)`` of the best paths, row = from. `stops` and `stations` are
    rows of them; a drone leaves ``stops[0]`` with `capacity_j`, all it can hold above the reserve.
    `curve_s` and `curve_j` are the charge curve from the reserve on.
    """

    seconds: Sequence[Sequence[float]]
    joules: Sequence[Sequence[float]]
    stops: Sequence[int]
    stations: Sequence[int]
    capacity_j: float
    curve_s: Sequence[float]
    curve_j: Sequence[float]


class ChargingPeer(Protocol):
    """Decides where to charge and how much, the order of the stops given."""

    package: str

    def delivery_time_s(self, task: ChargingTask) -> float:
        """When the last stop is reached at the earliest; inf if it cannot be."""


@dataclass(frozen=True, slots=True)
class PathTask:
    """Segments as arrays, ``(m,)`` each: rows of the stations they join, and metres."""

    stations: int
    from_row: npt.NDArray[np.int32]
    to_row: npt.NDArray[np.int32]
    length_m: npt.NDArray[np.float64]


class PathPeer(Protocol):
    """Finds the shortest paths from one station to all others."""

    package: str

    def prepare(self, task: PathTask) -> Any:  # the peer's own graph
        """The network in the peer's own form."""

    def lengths_m(self, graph: Any, source: int) -> npt.NDArray[np.float64]:  # see above
        """Metres from the source to each station, ``(n,)``; inf where there is no path."""
