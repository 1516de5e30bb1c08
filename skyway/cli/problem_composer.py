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

#: Networks kept; each may take as much memory as the rest of the program.
_KEPT = 4


@dataclass(slots=True)
class RecentNetworks:
    """Networks and their airspaces by the content of their JSON, the latest last."""

    _kept: dict[bytes, tuple[Network, Airspace]] = field(default_factory=dict)

    def prepared(self, value: Any) -> tuple[Network, Airspace]:  # any JSON value
        """The network that this JSON describes, ready to compose on.

        Raises
        ------
        InvalidNetwork
            It describes none.
        """
        # Version 2 of the format writes equal values equally, and tells true from 1.
        key = sha256(marshal.dumps(value, 2)).digest()
        known = self._kept.pop(key, None)
        if known is None:
            network = network_of(value)
            known = network, Airspace.of(network)
        self._kept[key] = known
        if len(self._kept) > _KEPT:
            del self._kept[next(iter(self._kept))]
        return known


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
            # A defect of the planner: such a plan must not fly, so there is none.
            return Plan(status=PlanStatus.UNKNOWN, stats={"rejected": str(error)})

    def _problem(self, document: Any) -> tuple[Problem, Airspace | None]:
        if not isinstance(document, dict):
            return read_problem(document), None
        document = document | self.overrides
        airspace = None
        if "network" in document:
            # What is wrong with a network, read_problem says, beside what else is wrong.
            with suppress(InvalidNetwork):
                document["network"], airspace = self._networks.prepared(document["network"])
        return read_problem(document), airspace
