"""Composes one problem after another, as `skyway compose` reads them."""

import marshal
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import sha256
from typing import Any

from skyway.delivery.plan import Plan, PlanStatus
from skyway.errors import InvalidNetwork
from skyway.network.network import Network
from skyway.planner.airspace import Airspace
from skyway.planner.compose import compose
from skyway.planner.problem import Problem, network_of
from skyway.planner.problem_document import read_problem
from skyway.planner.verify import PlanRejected

#: Networks in the cache; each may need as much memory as the rest of the program.
_MOST_CACHED = 4


@dataclass(slots=True)
class RecentNetworks:
    """A cache of networks and their airspaces by the content of their JSON, the latest last.

    Hundreds of problems often share one network, and reading a network is slow.
    """

    _cached: dict[bytes, tuple[Network, Airspace]] = field(default_factory=dict)

    def prepared(self, value: Any) -> tuple[Network, Airspace]:  # any JSON value
        """The network that this JSON describes, ready to compose on.

        Raises
        ------
        InvalidNetwork
            The JSON is not a network.
        """
        # Version 2 of the format writes equal values equally, and distinguishes true from 1.
        key = sha256(marshal.dumps(value, 2)).digest()
        cached = self._cached.pop(key, None)
        if cached is None:
            network = network_of(value)
            cached = network, Airspace.of(network)
        self._cached[key] = cached
        if len(self._cached) > _MOST_CACHED:
            del self._cached[next(iter(self._cached))]
        return cached


@dataclass(slots=True)
class ProblemComposer:
    """Composes one document after another; `overrides` replace fields of each problem."""

    overrides: dict[str, Any]  # any JSON value
    _networks: RecentNetworks = field(default_factory=RecentNetworks)

    def plan(self, document: Any) -> Plan:  # any JSON value; read_problem checks it
        """The plan for a problem.

        Raises
        ------
        InvalidInput
            The document is not a problem.
        """
        problem, airspace = self._problem(document)
        try:
            return compose(problem, airspace=airspace)
        except PlanRejected as error:
            # A defect of the planner: no drone may fly this plan, so there is no plan.
            return Plan(status=PlanStatus.UNKNOWN, stats={"rejected": str(error)})

    def _problem(self, document: Any) -> tuple[Problem, Airspace | None]:
        if not isinstance(document, dict):
            return read_problem(document), None
        document = document | self.overrides
        airspace = None
        if "network" in document:
            # read_problem reports the faults of the network together with all other faults.
            with suppress(InvalidNetwork):
                document["network"], airspace = self._networks.prepared(document["network"])
        return read_problem(document), airspace
