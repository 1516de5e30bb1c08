"""GET /internal/providers/{provider_id}/drone-quota."""

from typing import Annotated

from fastapi import Depends

from skyway.contracts.drones import DroneQuota
from skyway.ids import ProviderId
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway_provider_registry.fleets.quota_store import DroneLimit


def quota_routes(*, gate: ServiceGate, limit: DroneLimit) -> ServiceRouter:
    """GET /internal/providers/{provider_id}/drone-quota."""
    router = ServiceRouter(tags=("internal",))

    @router.get("/internal/providers/{provider_id}/drone-quota")
    async def get_drone_quota(
        provider_id: ProviderId, caller: Annotated[Caller, Depends(gate)]
    ) -> DroneQuota:
        """How many drones a provider may have, and has."""
        caller.must_be_service("gateway")
        return await limit.quota(provider_id)

    return router
