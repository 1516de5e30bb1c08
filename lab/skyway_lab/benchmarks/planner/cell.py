"""A cell of the tables: what kind of request is planned on what kind of network."""

from dataclasses import dataclass
from typing import Literal

#: Metres from the source within which a local request's destinations lie.
LOCAL_REACH_M = 45_000.0

Policy = Literal["partial", "full"]


@dataclass(frozen=True, slots=True)
class Cell:
    """Requests of one kind; ``reach_m`` None spreads the destinations over the whole network."""

    stations: int
    packages: int
    policy: Policy = "partial"
    reach_m: float | None = None
