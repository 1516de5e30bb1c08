"""Composes one problem after another, as `skyway compose` reads them."""

from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from skyway.cli.recent_networks import RecentNetworks
from skyway.delivery.plan import Plan, PlanStatus
from skyway.errors import InvalidNetwork
from skyway.planner.airspace import Airspace
from skyway.planner.compose import compose
from skyway.planner.problem import Problem
from skyway.planner.problem_document import read_problem
from skyway.planner.verify import PlanRejected


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
