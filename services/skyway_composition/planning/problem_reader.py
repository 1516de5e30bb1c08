"""Problems that refer to a published network: with its version, and who holds its pads."""

import asyncio
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any, Self

from pydantic import AwareDatetime, Field, TypeAdapter, ValidationError

from skyway.errors import InvalidProblem
from skyway.ids import NetworkId
from skyway.json_model import JsonModel
from skyway.planner.problem import Problem
from skyway.planner.problem_document import read_problem
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import NotFound
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.planning.world import World


class NetworkReference(JsonModel):
    """A published network; without version its current one."""

    network_id: NetworkId
    version: Annotated[int, Field(ge=1)] | None = None

    @classmethod
    def of(cls, value: Any) -> Self:  # any JSON object
        """The reference in a problem's `network`.

        Raises
        ------
        InvalidProblem
            Names the field at fault.
        """
        try:
            return cls.model_validate(value)
        except ValidationError as error:
            fault = error.errors()[0]
            field = ".".join(str(part) for part in ("network", *fault["loc"]))
            raise InvalidProblem(field, fault["msg"]) from error


@dataclass(frozen=True, slots=True)
class ProblemReader:
    """Completes problems with what composition knows."""

    db: Database
    networks: PreparedNetworks
    clock: FleetClock

    async def problem(
        self, document: dict[str, Any], reference: NetworkReference
    ) -> tuple[Problem, World]:
        """The problem on the network referred to, and the world that holds the known pads.

        Raises
        ------
        InvalidProblem
            There is no such network or version, or fields of the problem are wrong.
        """
        try:
            skyway = (
                await self.networks.current(reference.network_id)
                if reference.version is None
                else await self.networks.version(reference.network_id, reference.version)
            )
        except NotFound as error:
            raise InvalidProblem("network", str(error)) from error
        start_at = _start_at(document) or self.clock.now()
        complete = {**document, "network": skyway.network}
        if document.get("start_at") is None:
            complete["start_at"] = start_at
        problem = await asyncio.to_thread(read_problem, complete)
        after_ms = moment_to_ms(start_at)
        # Pure planning: margins are added where something is booked.
        return problem, await World.of(skyway, self.db, after_ms=after_ms, pad_gap_s=0.0)


def _start_at(document: dict[str, Any]) -> datetime | None:
    """The start that a problem gives, None when it gives none, or none that can be read."""
    try:
        moment: datetime = TypeAdapter(AwareDatetime).validate_python(document.get("start_at"))
    except ValidationError:
        return None
    return moment
