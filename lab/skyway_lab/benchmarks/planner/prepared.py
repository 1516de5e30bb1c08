"""The data that a service prepares for a network and its pads before any request."""

import time
from dataclasses import dataclass

from skyway.network.network import Network
from skyway.planner.airspace import Airspace
from skyway.planner.hierarchy import Hierarchy
from skyway.planner.pad_book import PadBook


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """The pads held by others, the airspace, and the hierarchy of a network if it has one."""

    book: PadBook
    airspace: Airspace
    hierarchy: Hierarchy | None = None


def hierarchy_of(network: Network) -> tuple[Hierarchy, float]:
    """The network's hierarchy, and the seconds that making it took."""
    started = time.perf_counter()
    hierarchy = Hierarchy.of(network)
    return hierarchy, time.perf_counter() - started
