"""The gateway asks who could fly a request."""

from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Depends

from skyway.contracts.candidate import (
    CandidateQuery,
    Candidates,
    PayloadLimit,
    PayloadLimitQuery,
)
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database
from skyway.runtime.http_app import internal_body
from skyway.runtime.identity import Caller, ServiceGate
from skyway_provider_registry.candidates.payload_limit import payload_limit
from skyway_provider_registry.candidates.reasons import KnownDrone, KnownProvider
from skyway_provider_registry.candidates.select import select
from skyway_provider_registry.fleets import store as fleets
from skyway_provider_registry.fleets.fleet_drone import FleetDrone
from skyway_provider_registry.providers import store as providers
from skyway_provider_registry.providers.provider import Provider


def candidate_routes(*, db: Database, gate: ServiceGate, clock: FleetClock) -> APIRouter:
    """POST /internal/candidates and /internal/payload-limit."""
    router = APIRouter(tags=["internal"])

    @router.post("/internal/candidates")
    async def find_candidates(
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[CandidateQuery, Depends(internal_body(CandidateQuery))],
    ) -> Candidates:
        """The drones that could fly a request now, and why the other providers have none."""
        caller.must_be("service")
        async with db.read() as connection:
            every_provider = await providers.every(connection)
            every_drone = await fleets.every(connection)
        wall_now = clock.wall_now()
        return select(
            query,
            providers=[_known_provider(provider) for provider in every_provider],
            drones=[_known_drone(drone, wall_now) for drone in every_drone],
        )

    @router.post("/internal/payload-limit")
    async def find_payload_limit(
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[PayloadLimitQuery, Depends(internal_body(PayloadLimitQuery))],
    ) -> PayloadLimit:
        """The heaviest payload that any admitted provider's drones can lift, busy or not."""
        caller.must_be("service")
        choice = query.providers
        named = (*filter(None, [choice.pinned]), *(choice.allowed or ()), *(choice.denied or ()))
        async with db.read() as connection:
            every_provider = await providers.every(connection)
            models = await fleets.models_by_provider(connection)
            unknown = await providers.unknown_of(connection, named)
        admitted = {
            provider.provider_id
            for provider in every_provider
            if provider.state == "ACTIVE" and choice.admits(provider.provider_id)
        }
        able = [model for provider_id, model in models if provider_id in admitted]
        return payload_limit(able, unknown_provider_ids=unknown)

    return router


def _known_provider(provider: Provider) -> KnownProvider:
    return KnownProvider(
        provider_id=provider.provider_id,
        tariff=provider.tariff,
        is_active=provider.state == "ACTIVE",
        loading=provider.loading,
    )


def _known_drone(drone: FleetDrone, wall_now: datetime) -> KnownDrone:
    told = drone.presence.state
    return KnownDrone(
        drone_id=drone.drone_id,
        provider_id=drone.provider_id,
        model=drone.model,
        home_station_id=drone.home_station_id,
        state=drone.state(wall_now),
        station_id=told.station_id if told else None,
        position=told.position if told else drone.home_position,
        soc=told.soc if told else drone.initial_soc,
        is_busy=drone.presence.mission_id is not None,
    )
