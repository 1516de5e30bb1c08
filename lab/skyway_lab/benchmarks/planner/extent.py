"""How much of everything is measured: a short run, or all of it."""

from collections.abc import Mapping
from dataclasses import dataclass

from skyway_lab.benchmarks.planner.cell import Policy
from skyway_lab.benchmarks.planner.solving import Limits

#: The shares of the pads' time that are taken, by how the drone recharges.
Shares = Mapping[Policy, tuple[float, ...]]

_ALL_TAKEN = (0.0, 0.5, 0.7, 0.85)


@dataclass(frozen=True, slots=True)
class Extent:
    """Sizes and limits of the parts.

    `tree_stations` and `tree_shares` are planned without a hierarchy; at the shares in
    `ordering_taken` the peers compete.
    """

    packages: tuple[int, ...]
    whole_stations: tuple[int, ...]
    whole_shares: Shares
    tree_stations: tuple[int, ...]
    tree_shares: Shares
    local_stations: tuple[int, ...]
    local_shares: Shares
    limits: Limits
    contestant_packages: tuple[int, ...]
    contestant_limits: Limits
    ordering_taken: tuple[float, ...]
    ordering_runs: int
    charging_runs: tuple[tuple[int, int], ...]
    starts: int
    trips: int
    trip_shares: tuple[float, ...]
    scarce_runs: int


SHORT = Extent(
    packages=(3, 8),
    whole_stations=(35, 1_000, 10_000, 100_000),
    whole_shares={"partial": (0.0, 0.5), "full": (0.0,)},
    tree_stations=(10_000,),
    tree_shares={"partial": (0.5,)},
    local_stations=(1_000, 100_000, 1_000_000),
    local_shares={"partial": (0.7,)},
    limits=Limits(runs=7, solve_s=2.0, cell_s=5.0),
    contestant_packages=(1, 3),
    contestant_limits=Limits(runs=3, solve_s=3.0, cell_s=8.0),
    ordering_taken=(0.5,),
    ordering_runs=5,
    charging_runs=((200, 3), (1_000, 1)),
    starts=1,
    trips=2_000,
    trip_shares=(0.5,),
    scarce_runs=2,
)

FULL = Extent(
    packages=(3, 5, 8, 12),
    whole_stations=(35, 1_000, 10_000, 100_000),
    whole_shares={"partial": _ALL_TAKEN, "full": _ALL_TAKEN},
    tree_stations=(35, 1_000, 10_000, 100_000),
    tree_shares={"partial": (0.0, 0.5, 0.85)},
    local_stations=(1_000, 10_000, 100_000, 1_000_000),
    local_shares={"partial": _ALL_TAKEN, "full": _ALL_TAKEN},
    limits=Limits(runs=12, solve_s=2.0, cell_s=6.0),
    contestant_packages=(1, 2, 3, 5),
    contestant_limits=Limits(runs=10, solve_s=20.0, cell_s=90.0),
    ordering_taken=(0.0, 0.5, 0.85),
    ordering_runs=20,
    charging_runs=((200, 10), (1_000, 5)),
    starts=5,
    trips=2_000,
    trip_shares=_ALL_TAKEN,
    scarce_runs=6,
)
