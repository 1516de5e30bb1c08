"""POST /v1/compositions and quotes: planning that changes nothing.

A problem may refer to a published network; then it is completed with the network's reservations.
"""

import asyncio
from collections.abc import Set
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Annotated, Any, Final, Protocol, Self

from fastapi import Depends, Request
from pydantic import Field, TypeAdapter, ValidationError, create_model

from skyway.bounds import Moment
from skyway.complaints import fault_of
from skyway.contracts.network_document import NetworkDocument, settings_of
from skyway.contracts.quote import QuoteAnswer, QuoteQuery
from skyway.delivery.plan import Plan
from skyway.errors import InvalidProblem
from skyway.ids import NetworkId
from skyway.json_model import JsonModel
from skyway.planner.compose import STRATEGIES
from skyway.planner.problem import Problem
from skyway.planner.problem_document import read_problem
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import AccessDenied, NotFound
from skyway.runtime.http.answers import NOT_FOUND
from skyway.runtime.http.app import internal_body, read_json, takes_bytes
from skyway.runtime.http.client_disconnect import cancel_on_disconnect
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.openapi_document import body_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.networks.prepared import NOTHING_PUBLISHED, PreparedNetworks
from skyway_composition.networks.routes import VersionNumber
from skyway_composition.networks.store import has_networks
from skyway_composition.planning.no_show_store import NoShows
from skyway_composition.planning.solver_pool import ReadingTurn, SolverPool
from skyway_composition.planning.world import World

#: The most bytes of a problem with its network (docs/reference/rest.md).
COMPOSITION_LIMIT_BYTES: Final = 256 * 1024 * 1024

#: Problems up to this size are read without a thread, in less than a millisecond.
_SMALL_BYTES: Final = 16 * 1024

# Built once, because building takes longer than reading.
_MOMENT: Final[TypeAdapter[datetime]] = TypeAdapter(Moment)


class NetworkReference(JsonModel):
    """A published network in the place of a network's GeoJSON."""

    network_id: Annotated[NetworkId, Field(description="Id of the published network.")]
    version: VersionNumber = None

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
            raise InvalidProblem(*fault_of(error.errors()[0], "network")) from error


#: The body of POST /v1/compositions; `read_problem` reads it.
CompositionProblem: Final = create_model(
    "CompositionProblem",
    __doc__="A problem of the planner; its network is GeoJSON, or a published network.",
    __base__=Problem,
    network=Annotated[
        NetworkReference | NetworkDocument,
        Field(description="The network: GeoJSON, or the id of a published network."),
    ],
)


@dataclass(frozen=True, slots=True)
class ProblemReader:
    """Reads problems and adds the published network and its reservations."""

    db: Database
    networks: PreparedNetworks
    clock: FleetClock

    async def problem(
        self, document: dict[str, Any], reference: NetworkReference, *, size_bytes: int
    ) -> tuple[Problem, World]:
        """The problem on a published network, and the world with this network's reservations.

        `size_bytes` is how long the document is as text.

        Raises
        ------
        InvalidProblem
            There is no such network or version, or a field of the problem is wrong.
        """
        start_at = _start_at(document) or self.clock.now()
        world = await self._world(reference, after_ms=moment_to_ms(start_at))
        complete = {**document, "network": world.skyway.network}
        if document.get("start_at") is None:
            complete["start_at"] = start_at
        problem = (
            read_problem(complete)
            if size_bytes <= _SMALL_BYTES
            else await asyncio.to_thread(read_problem, complete)
        )
        return problem, world

    async def _world(self, reference: NetworkReference, *, after_ms: int) -> World:
        """The world of the network version; pure planning adds no margins, only bookings do."""
        try:
            present = await self.networks.present(reference.network_id)
            if reference.version is not None:
                present = replace(present, version=reference.version)
            return await World.at(
                present, self.networks, db=self.db, after_ms=after_ms, pad_gap_s=0.0
            )
        except NotFound as error:
            async with self.db.read() as connection:
                is_empty = not await has_networks(connection)
            detail = NOTHING_PUBLISHED if is_empty else str(error)
            raise InvalidProblem("network", detail) from error


def _start_at(document: dict[str, Any]) -> datetime | None:
    """The start that a problem gives; None when it is missing or cannot be read."""
    try:
        return _MOMENT.validate_python(document.get("start_at"))
    except ValidationError:
        return None


class QuoteAnswerer(Protocol):
    """Answers requests for quotes."""

    async def answer(self, query: QuoteQuery) -> QuoteAnswer:
        """The best offer of each provider, best first, and why the others make no offer."""
        ...


def quote_routes(*, gate: ServiceGate, quotes: QuoteAnswerer, no_shows: NoShows) -> ServiceRouter:
    """POST /internal/quotes, for the gateway."""
    router = ServiceRouter(tags=("quotes",))

    @router.post("/internal/quotes")
    async def quote_missions(
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[QuoteQuery, Depends(internal_body(QuoteQuery))],
    ) -> QuoteAnswer:
        """Plan what each provider would offer for a request; hold the best offers if asked to."""
        caller.must_be_service("gateway")
        shortlist = await no_shows.marked(query.shortlist)
        return await quotes.answer(query.model_copy(update={"shortlist": shortlist}))

    return router


@dataclass(frozen=True, slots=True)
class StrategyRights:
    """The strategies for everybody; operators and other services may ask for all."""

    open_to_all: Set[str]

    @classmethod
    def read(cls, names: str) -> Self:
        """The rights with these strategies for everybody, separated by commas."""
        return cls(frozenset(each.strip() for each in names.split(",")))

    def check(self, document: Any, caller: Caller) -> None:  # any JSON value
        """Go on only if the caller may ask for the strategy; unknown ones are refused later.

        Raises
        ------
        AccessDenied
            The strategy of the problem is for operators.
        """
        strategy = document.get("strategy") if isinstance(document, dict) else None
        if not isinstance(strategy, str) or strategy not in STRATEGIES:
            return
        if strategy not in self.open_to_all and caller.role in ("customer", "provider"):
            raise AccessDenied(f"the strategy {strategy} is for operators")


def composition_routes(
    *,
    gate: ServiceGate,
    problems: ProblemReader,
    solver: SolverPool,
    rights: StrategyRights,
    reading: ReadingTurn,
) -> ServiceRouter:
    """POST /v1/compositions; `rights` say who may ask for which strategy."""
    router = ServiceRouter(tags=("compositions",))

    @router.post(
        "/v1/compositions",
        response_model=Plan,
        responses=NOT_FOUND,
        openapi_extra=body_of(CompositionProblem),
    )
    @takes_bytes(COMPOSITION_LIMIT_BYTES)
    async def compose_plan(request: Request, caller: Annotated[Caller, Depends(gate)]) -> Plan:
        """Compose the plan for a problem, or say why no plan exists."""
        caller.must_be("customer", "provider", "operator", "service")
        return await cancel_on_disconnect(request, lambda read: plan_for(read, caller))

    async def plan_for(request: Request, caller: Caller) -> Plan:
        document = await read_json(request, in_thread=reading.run)
        rights.check(document, caller)
        network = document.get("network") if isinstance(document, dict) else None
        if isinstance(network, dict) and "network_id" in network:
            problem, world = await problems.problem(
                document,
                NetworkReference.of(network),
                size_bytes=len(await request.body()),
            )
            # A problem has its own weather; without it plans assume still air.
            return await solver.compose_in(world.in_still_air(), problem)
        problem = await reading.run(read_problem, document)
        settings_of(problem.network, "network")  # no plan needs them, but faults are named
        return await solver.compose(problem)

    return router
