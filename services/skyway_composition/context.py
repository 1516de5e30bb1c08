"""What the rooms of missions need: the database, the time, new ids, networks, and the solver."""

from dataclasses import dataclass, field, replace
from typing import Self

from skyway.runtime.clock import FleetClock
from skyway.runtime.loops import Wake
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.planning.solver_pool import SolverPool


@dataclass(frozen=True, slots=True, kw_only=True)
class Context:
    """Built once in `parts.py`. A `Wake` starts a loop when another part has work for it."""

    db: Database
    clock: FleetClock
    mint: Mint
    networks: PreparedNetworks
    solver: SolverPool
    #: A mission needs another plan.
    stuck: Wake = field(default_factory=Wake)
    #: A drone became free, or a mission waits behind another one.
    calendars: Wake = field(default_factory=Wake)
    #: Calendars have changed otherwise than planned: another order may be better now.
    dispatches: Wake = field(default_factory=Wake)

    @property
    def now_ms(self) -> int:
        """The fleet clock's present moment in milliseconds."""
        return moment_to_ms(self.clock.now())

    def planning_with(self, solver: SolverPool) -> Self:
        """The same context, but plans are composed by this solver."""
        return replace(self, solver=solver)
