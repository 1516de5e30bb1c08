"""Statistics of fleets over REST: operators see all drones, a provider its own."""

from typing import Annotated

from fastapi import Depends

from skyway.ids import ProviderId
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_provider_registry.fleets import statistics_store
from skyway_provider_registry.fleets.statistics import FleetStatistics, totals
from skyway_provider_registry.presence.drone_presence import SILENCE


def fleet_statistics_routes(*, db: Database, gate: ServiceGate, clock: FleetClock) -> ServiceRouter:
    """GET /v1/stats/fleets."""
    router = ServiceRouter(tags=("statistics",))

    @router.get("/v1/stats/fleets")
    async def get_fleet_statistics(caller: Annotated[Caller, Depends(gate)]) -> FleetStatistics:
        """Count the drones in each state, and measure how late their messages arrive."""
        caller.must_be("provider", "operator")
        provider_id = ProviderId(caller.subject_id) if caller.role == "provider" else None
        since_ms = moment_to_ms(clock.wall_now() - SILENCE)
        async with db.read() as connection:
            rows = await statistics_store.groups(
                connection, provider_id, received_since_wall_ms=since_ms
            )
        return totals(rows, at=clock.now(), rate=clock.rate)

    return router
