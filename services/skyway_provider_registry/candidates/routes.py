"""The gateway and composition ask for drones that could fly a request.

Composition also asks which drones may not fly, how many drones a network has, and which providers
exchange deliveries.
"""

from collections.abc import Sequence
from typing import Annotated

from fastapi import Depends, Response

from skyway.contracts.candidate import (
    CANDIDATE_LISTS,
    CandidateQueries,
    CandidateQuery,
    PayloadLimit,
    PayloadLimitQuery,
)
from skyway.contracts.drones import (
    EXCHANGING,
    NETWORK_DRONES,
    OUT_OF_SERVICE,
    ExchangingProviders,
    NetworkDrones,
    OutOfServiceAnswer,
    OutOfServiceQuery,
)
from skyway.contracts.shortlist import CandidateLists, Candidates
from skyway.ids import NetworkId
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.service_router import ServiceRouter
from skyway.units import moment_to_ms
from skyway_provider_registry.candidates.fleet_view import FleetView, count_drones
from skyway_provider_registry.candidates.selection import payload_limit, select_each
from skyway_provider_registry.context import Context
from skyway_provider_registry.fleets import store as fleets
from skyway_provider_registry.providers import store as providers


def candidate_routes(context: Context, *, view: FleetView) -> ServiceRouter:
    """Candidates, the payload limit, and the drones of a network, under /internal."""
    router = ServiceRouter(tags=("internal",))

    async def select_now(queries: Sequence[CandidateQuery]) -> tuple[Candidates, ...]:
        """An answer to each question, all from the same fleets."""
        async with view.unchanged() as fleet:
            wall_now_ms, now_ms = (
                moment_to_ms(context.clock.wall_now()),
                moment_to_ms(context.clock.now()),
            )
            return await select_each(queries, fleet, wall_now_ms=wall_now_ms, now_ms=now_ms)

    @router.post("/internal/candidates", response_model=Candidates)
    async def find_candidates(
        caller: Annotated[Caller, Depends(context.gate)],
        query: Annotated[CandidateQuery, Depends(internal_body(CandidateQuery))],
    ) -> Response:
        """The drones that could fly a request now, and why the other providers have none."""
        caller.must_be_service("gateway")
        [found] = await select_now([query])
        # Serialized here: the answer is valid, and FastAPI would validate each model again.
        return Response(found.model_dump_json(), media_type="application/json")

    @router.post(CANDIDATE_LISTS, response_model=CandidateLists)
    async def find_candidate_lists(
        caller: Annotated[Caller, Depends(context.gate)],
        asked: Annotated[CandidateQueries, Depends(internal_body(CandidateQueries))],
    ) -> Response:
        """The drones that could fly each of several requests now, by one state of the fleets."""
        caller.must_be_service("gateway", "composition")
        found = CandidateLists.model_construct(answers=await select_now(asked.queries))
        return Response(found.model_dump_json(), media_type="application/json")

    @router.post("/internal/payload-limit")
    async def find_payload_limit(
        caller: Annotated[Caller, Depends(context.gate)],
        query: Annotated[PayloadLimitQuery, Depends(internal_body(PayloadLimitQuery))],
    ) -> PayloadLimit:
        """The heaviest payload that any admitted provider's drones can lift, busy or not."""
        caller.must_be_service("gateway")
        return payload_limit(await view.refreshed(), query.providers)

    @router.get(NETWORK_DRONES)
    async def count_network_drones(
        network_id: NetworkId, caller: Annotated[Caller, Depends(context.gate)]
    ) -> NetworkDrones:
        """How many drones of each model stand in a network, and how many could fly now."""
        caller.must_be_service("composition")
        fleet = await view.refreshed()
        return count_drones(fleet, network_id, wall_now_ms=moment_to_ms(context.clock.wall_now()))

    return router


def service_state_routes(context: Context) -> ServiceRouter:
    """POST /internal/drones-out-of-service, GET /internal/exchanging-providers."""
    router = ServiceRouter(tags=("internal",))

    @router.get(EXCHANGING)
    async def find_exchanging_providers(
        caller: Annotated[Caller, Depends(context.gate)],
    ) -> ExchangingProviders:
        """The active providers that exchange deliveries, with their tariffs."""
        caller.must_be_service("composition")
        async with context.db.read() as connection:
            return await providers.exchanging(connection)

    @router.post(OUT_OF_SERVICE)
    async def find_drones_out_of_service(
        caller: Annotated[Caller, Depends(context.gate)],
        query: Annotated[OutOfServiceQuery, Depends(internal_body(OutOfServiceQuery))],
    ) -> OutOfServiceAnswer:
        """Which of these drones may not begin a mission, and which get no further missions."""
        caller.must_be_service("composition")
        async with context.db.read() as connection:
            return await fleets.out_of_service(connection, query.drone_ids)

    return router
