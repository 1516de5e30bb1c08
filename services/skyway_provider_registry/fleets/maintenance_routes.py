"""Maintenance over REST: providers set rules for their models, and record what was done."""

from functools import partial
from typing import Annotated

from fastapi import Depends, Response

from skyway.errors import InvalidInput
from skyway.ids import DroneId, DroneModelId, ProviderId
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_provider_registry.fleets import store
from skyway_provider_registry.fleets.drone import Drone
from skyway_provider_registry.presence import maintenance_store
from skyway_provider_registry.presence.wear import MaintenanceRule, ModelMaintenance
from skyway_provider_registry.providers import store as providers


class MaintenanceRules(JsonModel):
    """The maintenance rules of a provider, by model."""

    items: tuple[ModelMaintenance, ...]


def maintenance_routes(*, db: Database, gate: ServiceGate, clock: FleetClock) -> ServiceRouter:
    """/v1/providers/{provider_id}/maintenance-rules, and .../drones/{drone_id}/maintenance."""
    router = ServiceRouter(tags=("drones",), prefix="/v1/providers/{provider_id}")

    @router.get("/maintenance-rules")
    async def list_maintenance_rules(
        provider_id: ProviderId, caller: Annotated[Caller, Depends(gate)]
    ) -> MaintenanceRules:
        """List a provider's rules, by model."""
        caller.must_be("operator", "provider")
        async with db.read() as connection:
            await providers.of_caller(connection, caller, provider_id=provider_id)
            return MaintenanceRules(
                items=tuple(await maintenance_store.rules_of(connection, provider_id))
            )

    @router.put("/maintenance-rules/{model_id}")
    async def put_maintenance_rule(
        provider_id: ProviderId,
        model_id: DroneModelId,
        caller: Annotated[Caller, Depends(gate)],
        requested: MaintenanceRule,
    ) -> ModelMaintenance:
        """Set after how many hours or cycles the provider's drones of a model are due.

        What they have flown before counts too.
        """
        caller.must_be("operator", "provider")
        async with db.write() as tx:
            await providers.of_caller(tx.connection, caller, provider_id=provider_id)
            if model_id not in await store.every_model(tx.connection):
                raise InvalidInput("model_id", f"no drone model is called {model_id!r}")
            await maintenance_store.put_rule(tx, provider_id, model_id, requested, at=clock.now())
        return ModelMaintenance(model_id=model_id, **requested.model_dump())

    @router.delete("/maintenance-rules/{model_id}", status_code=204)
    async def delete_maintenance_rule(
        provider_id: ProviderId, model_id: DroneModelId, caller: Annotated[Caller, Depends(gate)]
    ) -> Response:
        """Remove the rule for a model; its drones are not due any more."""
        caller.must_be("operator", "provider")
        async with db.write() as tx:
            await providers.of_caller(tx.connection, caller, provider_id=provider_id)
            await maintenance_store.remove_rule(tx, provider_id, model_id, at=clock.now())
        return Response(status_code=204)

    @router.post("/drones/{drone_id}/maintenance")
    async def record_maintenance(
        provider_id: ProviderId, drone_id: DroneId, caller: Annotated[Caller, Depends(gate)]
    ) -> Drone:
        """Record that the maintenance of a drone was done: its counters begin at 0 again."""
        caller.must_be("operator", "provider")
        found = partial(store.of_caller, provider_id=provider_id, drone_id=drone_id)
        async with db.write() as tx:
            await found(tx.connection, caller)
            await maintenance_store.record_maintenance(tx, drone_id, at=clock.now())
            drone = await found(tx.connection, caller)
        return drone.shown(clock.wall_now())

    return router
