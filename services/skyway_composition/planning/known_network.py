"""Problems that refer to a published network: with its version, and who holds its pads."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any, Self

from pydantic import AwareDatetime, Field, TypeAdapter, ValidationError

from skyway.errors import InvalidProblem
from skyway.ids import NetworkId
from skyway.json_model import JsonModel
from skyway.planner.airspace import Airspace
from skyway.planner.problem import Problem
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database
from skyway.runtime.errors import NotFound
from skyway.units import moment_to_ms
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.pads.store import booked_after
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
class KnownNetworks:
    """Completes problems with what composition knows."""

    db: Database
    networks: PreparedNetworks
    clock: FleetClock

    async def problem(
        self, document: dict[str, Any], reference: NetworkReference
    ) -> tuple[Problem, Airspace]:
        """The problem on the network referred to; the reservations known are added to the given.

        Raises
        ------
        InvalidProblem
            There is no such network or version.
        ValidationError
            A field of the problem is wrong.
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
        start_ms = moment_to_ms(start_at)
        async with self.db.read() as connection:
            pads = await booked_after(connection, skyway.network_id, moment_ms=start_ms)
        known = World(skyway, pads).reservations_from(start_ms)
        given = document.get("pad_reservations", [])
        complete = {**document, "network": skyway.network, "start_at": start_at}
        if isinstance(given, list):
            # The given ones first: a complaint about one names its place in the caller's list.
            complete["pad_reservations"] = [*given, *known]
        if document.get("start_at") is not None:
            complete["start_at"] = document["start_at"]
        return Problem.model_validate(complete), skyway.airspace


def _start_at(document: dict[str, Any]) -> datetime | None:
    """The start that a problem gives, None when it gives none, or none that can be read."""
    try:
        moment: datetime = TypeAdapter(AwareDatetime).validate_python(document.get("start_at"))
    except ValidationError:
        return None
    return moment
