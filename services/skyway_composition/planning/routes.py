"""POST /v1/compositions and quotes: planning that changes nothing."""

import asyncio
from typing import Annotated, Final, Protocol

from fastapi import Depends, Request
from pydantic import Field, create_model

from skyway.contracts.quote import QuoteAnswer, QuoteQuery
from skyway.delivery.plan import Plan
from skyway.planner.problem import Problem
from skyway.planner.problem_document import read_problem
from skyway.runtime.http.app import internal_body, read_json
from skyway.runtime.http.client_disconnect import cancel_on_disconnect
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.openapi_document import body_of
from skyway.runtime.http.problem_answers import NOT_FOUND
from skyway.runtime.http.service_router import ServiceRouter
from skyway_composition.networks.settings import NetworkDocument
from skyway_composition.planning.problem_reader import NetworkReference, ProblemReader
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.world import compose_in

#: The most bytes of a problem with its network (docs/reference/rest.md).
COMPOSITION_LIMIT_BYTES: Final = 256 * 1024 * 1024

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


class QuoteAnswerer(Protocol):
    """Answers requests for quotes."""

    async def answer(self, query: QuoteQuery) -> QuoteAnswer:
        """The best offer of each provider, best first, and why the others make no offer."""
        ...


def quote_routes(*, gate: ServiceGate, quotes: QuoteAnswerer) -> ServiceRouter:
    """POST /internal/quotes, for the gateway."""
    router = ServiceRouter(tags=("quotes",))

    @router.post("/internal/quotes")
    async def quote_missions(
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[QuoteQuery, Depends(internal_body(QuoteQuery))],
    ) -> QuoteAnswer:
        """Plan what each provider would offer for a request; hold the best offers if asked to."""
        caller.must_be("service")
        return await quotes.answer(query)

    return router


def composition_routes(
    *, gate: ServiceGate, problems: ProblemReader, solver: SolverPool
) -> ServiceRouter:
    """POST /v1/compositions."""
    router = ServiceRouter(tags=("compositions",))

    @router.post(
        "/v1/compositions",
        response_model=Plan,
        responses=NOT_FOUND,
        openapi_extra=body_of(CompositionProblem),
    )
    async def compose_plan(request: Request, caller: Annotated[Caller, Depends(gate)]) -> Plan:
        """Compose the plan for a problem, or say why no plan exists."""
        caller.must_be("customer", "provider", "operator", "service")
        return await cancel_on_disconnect(request, plan_for)

    async def plan_for(request: Request) -> Plan:
        document = await read_json(request)
        network = document.get("network") if isinstance(document, dict) else None
        if isinstance(network, dict) and "network_id" in network:
            problem, world = await problems.problem(document, NetworkReference.of(network))
            return await compose_in(solver, world, problem)
        return await solver.compose(await asyncio.to_thread(read_problem, document))

    return router
