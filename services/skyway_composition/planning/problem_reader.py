"""Read problems that refer to a published network, and complete them with its reservations."""

import asyncio
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any, Self

from pydantic import Field, TypeAdapter, ValidationError

from skyway.bounds import Moment
from skyway.errors import InvalidProblem
from skyway.ids import NetworkId
from skyway.json_model import JsonModel
from skyway.planner.problem import Problem
from skyway.planner.problem_document import read_problem
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import NotFound
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.networks.prepared import NOTHING_PUBLISHED, PreparedNetworks
from skyway_composition.networks.store import has_networks
from skyway_composition.planning.world import World


class NetworkReference(JsonModel):
    """A published network in the place of a network's GeoJSON."""

    network_id: Annotated[NetworkId, Field(description="Id of the published network.")]
    version: Annotated[
        int | None,
        Field(ge=1, description="Number of the version; without it the current version."),
    ] = None

    @classmethod
    def of(cls, value: Any) -> Self:  # any JSON object
        """The reference in a problem's `network`.

        Raises
        ------
        InvalidProblem
            A field is wrong; the error names the field.
        """
        try:
            return cls.model_validate(value)
        except ValidationError as error:
            fault = error.errors()[0]
            field = ".".join(str(part) for part in ("network", *fault["loc"]))
            raise InvalidProblem(field, fault["msg"]) from error


@dataclass(frozen=True, slots=True)
class ProblemReader:
    """Reads problems and adds the published network and its reservations."""

    db: Database
    networks: PreparedNetworks
    clock: FleetClock

    async def problem(
        self, document: dict[str, Any], reference: NetworkReference
    ) -> tuple[Problem, World]:
        """The problem on a published network, and the world with this network's reservations.

        Raises
        ------
        InvalidProblem
            There is no such network or version, or a field of the problem is wrong.
        """
        try:
            skyway = (
                await self.networks.current(reference.network_id)
                if reference.version is None
                else await self.networks.version(reference.network_id, reference.version)
            )
        except NotFound as error:
            async with self.db.read() as connection:
                is_empty = not await has_networks(connection)
            detail = NOTHING_PUBLISHED if is_empty else str(error)
            raise InvalidProblem("network", detail) from error
        start_at = _start_at(document) or self.clock.now()
        complete = {**document, "network": skyway.network}
        if document.get("start_at") is None:
            complete["start_at"] = start_at
        problem = await asyncio.to_thread(read_problem, complete)
        after_ms = moment_to_ms(start_at)
        # Pure planning adds no margins; only bookings do.
        return problem, await World.of(skyway, self.db, after_ms=after_ms, pad_gap_s=0.0)


def _start_at(document: dict[str, Any]) -> datetime | None:
    """The start that a problem gives; None when it is missing or cannot be read."""
    try:
        moment: datetime = TypeAdapter(Moment).validate_python(document.get("start_at"))
    except ValidationError:
        return None
    return moment
