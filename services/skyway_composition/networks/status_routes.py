"""/v1/networks/{network_id}/status: whether a network accepts deliveries now."""

from typing import Annotated

from fastapi import Depends

from skyway.ids import DroneModelId, NetworkId
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.closures.network_weather import ClosedNow
from skyway_composition.closures.store import in_force
from skyway_composition.closures.weather_store import forecast_key
from skyway_composition.networks.prepared import PreparedNetworks, current_row
from skyway_composition.networks.service_status import (
    CountDrones,
    NetworkStatus,
    closed_to_models,
    status_of,
    without_counts,
)


def service_status_routes(
    *,
    db: Database,
    gate: ServiceGate,
    networks: PreparedNetworks,
    clock: FleetClock,
    count_drones: CountDrones,
) -> ServiceRouter:
    """GET /v1/networks/{network_id}/status."""
    router = ServiceRouter(tags=("networks",))

    @router.get("/v1/networks/{network_id}/status")
    async def get_network_status(
        network_id: NetworkId, caller: Annotated[Caller, Depends(gate)]
    ) -> NetworkStatus:
        """Show whether the network accepts deliveries now, and what restricts it.

        Only operators see how many drones there are.
        """
        caller.must_be("customer", "provider", "operator", "service")
        await current_row(db, network_id)
        drones = await count_drones(network_id)
        now_ms = moment_to_ms(clock.now())
        async with db.read() as connection:
            closures = await in_force(connection, network_id, after_ms=now_ms)
            has_forecast = await forecast_key(connection, network_id) is not None
        windy: dict[DroneModelId, ClosedNow] = {}
        if has_forecast:
            skyway = await networks.current(network_id)
            _, conditions = await skyway.conditions.read(db, after_ms=now_ms)
            windy = await closed_to_models(conditions.weather, drones, now_ms=now_ms)
        present = [each for each in closures if each.is_in_force(now_ms)]
        status = status_of(network_id, present, drones, now_ms=now_ms, windy=windy)
        return status if caller.role == "operator" else without_counts(status)

    return router
