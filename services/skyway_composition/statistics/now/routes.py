"""What is under way over REST: operators see all missions, a provider its own."""

from typing import Annotated

from fastapi import Depends

from skyway.contracts.message import FleetMoment
from skyway.ids import ProviderId
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_composition.statistics.now import store


class MissionStatistics(JsonModel):
    """Missions that are not over, by state; for operators, messages waiting to leave by channel."""

    at: FleetMoment
    by_state: dict[str, int]
    unsent: dict[str, int]


def mission_statistics_routes(
    *, db: Database, gate: ServiceGate, clock: FleetClock
) -> ServiceRouter:
    """GET /v1/stats/missions."""
    router = ServiceRouter(tags=("statistics",))

    @router.get("/v1/stats/missions")
    async def mission_statistics(caller: Annotated[Caller, Depends(gate)]) -> MissionStatistics:
        """How many missions that are not over are in which state, and what waits to be sent."""
        caller.must_be("provider", "operator")
        whose = ProviderId(caller.subject_id) if caller.role == "provider" else None
        async with db.read() as connection:
            by_state = await store.live_missions(connection, whose)
            unsent = await store.unsent(connection) if whose is None else {}
        return MissionStatistics(at=clock.now(), by_state=dict(by_state), unsent=dict(unsent))

    return router
