"""Batteries and maintenance of a provider's drones, over REST."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Annotated

from fastapi import Depends, Query, Response

from skyway.drone.model import DroneModel
from skyway.errors import InvalidInput
from skyway.ids import BatteryId, DroneId, DroneModelId, ProviderId
from skyway.json_model import JsonModel
from skyway.runtime.http.answers import conflicts
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway_provider_registry.context import Context
from skyway_provider_registry.fleets import battery_store, store
from skyway_provider_registry.fleets.battery import (
    Battery,
    BatteryChange,
    BatteryWithHistory,
    NewBattery,
    NewBatteryRow,
    RegisteredBatteries,
)
from skyway_provider_registry.fleets.drone import Drone
from skyway_provider_registry.fleets.registration_forms import GOOD_DRY_RUN, DryRun, OneOrMany
from skyway_provider_registry.presence import maintenance_store
from skyway_provider_registry.presence.store import touch
from skyway_provider_registry.presence.wear import MaintenanceRule, ModelMaintenance
from skyway_provider_registry.providers import store as providers

NewBatteries = OneOrMany[NewBattery]


@contextmanager
def in_item(index: int) -> Iterator[None]:
    """Name the place in the list in what is wrong with one of its items."""
    try:
        yield
    except InvalidInput as error:
        raise InvalidInput(f"{index}.{error.field}", error.detail) from error


def _refuse_taken(serials: Sequence[str], taken: Collection[str], *, is_list: bool) -> None:
    for index, serial in enumerate(serials):
        if serial in taken:
            detail = f"{serial!r} belongs to another of your batteries"
            raise InvalidInput(f"{index}.serial" if is_list else "serial", detail)


def battery_routes(context: Context) -> ServiceRouter:
    """/v1/providers/{provider_id}/batteries and /{battery_id}: POST, GET and DELETE."""
    router = ServiceRouter(tags=("drones",), prefix="/v1/providers/{provider_id}/batteries")

    def row_of(
        requested: NewBattery, provider_id: ProviderId, model: DroneModel | None
    ) -> NewBatteryRow:
        if model is None:
            raise InvalidInput(
                "model_id", f"no drone model that you may use is called {requested.model_id!r}"
            )
        return NewBatteryRow(
            battery_id=BatteryId(context.mint("bat")),
            provider_id=provider_id,
            requested=requested,
            capacity_j=requested.capacity_j or model.battery_j,
            state_of_health=requested.first_health(model),
            created_at=context.clock.now(),
        )

    def rows_of(
        requested: NewBatteries, provider_id: ProviderId, models: Mapping[DroneModelId, DroneModel]
    ) -> list[NewBatteryRow]:
        if not isinstance(requested, list):
            return [row_of(requested, provider_id, models.get(requested.model_id))]
        rows = []
        for index, each in enumerate(requested):
            with in_item(index):
                rows.append(row_of(each, provider_id, models.get(each.model_id)))
                if any(each.serial == other.serial for other in requested[:index]):
                    raise InvalidInput("serial", f"{each.serial!r} stands twice in this list")
        return rows

    @router.post(
        "",
        status_code=201,
        response_model=Battery | RegisteredBatteries,
        responses={**conflicts("SERIAL_TAKEN", "TOO_MANY_BATTERIES"), **GOOD_DRY_RUN},
    )
    async def register_batteries(
        provider_id: ProviderId,
        caller: Annotated[Caller, Depends(context.gate)],
        requested: NewBatteries,
        query: Annotated[DryRun, Query()],
        response: Response,
    ) -> Battery | RegisteredBatteries | Response:
        """Register one battery or a list, all or none; a serial number is registered once."""
        caller.must_be("operator", "provider")
        if query.dry_run:
            async with context.db.read() as connection:
                await providers.of_caller(connection, caller, provider_id=provider_id)
                rows = rows_of(
                    requested, provider_id, await store.usable_models(connection, provider_id)
                )
                await battery_store.refuse_too_many(connection, provider_id, new=len(rows))
                serials = [each.requested.serial for each in rows]
                taken = await battery_store.taken_serials(connection, provider_id, serials)
            _refuse_taken(serials, taken, is_list=isinstance(requested, list))
            return Response(status_code=204)
        async with context.db.write() as tx:
            await providers.of_caller(tx.connection, caller, provider_id=provider_id)
            rows = rows_of(
                requested, provider_id, await store.usable_models(tx.connection, provider_id)
            )
            await battery_store.add(tx, rows)
            ids = [each.battery_id for each in rows]
            stored = await battery_store.some(tx.connection, provider_id, ids)
        if isinstance(requested, list):
            return RegisteredBatteries(items=tuple(stored[each] for each in ids))
        response.headers["Location"] = f"/v1/providers/{provider_id}/batteries/{ids[0]}"
        return stored[ids[0]]

    @router.get("")
    async def list_batteries(
        provider_id: ProviderId,
        caller: Annotated[Caller, Depends(context.gate)],
        query: Annotated[PageQuery, Query()],
    ) -> Page[Battery]:
        """List the batteries of a provider, by id."""
        caller.must_be("operator", "provider")
        async with context.db.read() as connection:
            await providers.of_caller(connection, caller, provider_id=provider_id)
            rows = await battery_store.page(connection, provider_id, query)
        return page_of(
            rows, query, item=lambda each: each, sort_key=lambda each: (each.battery_id,)
        )

    @router.get("/{battery_id}")
    async def get_battery(
        provider_id: ProviderId,
        battery_id: BatteryId,
        caller: Annotated[Caller, Depends(context.gate)],
    ) -> BatteryWithHistory:
        """Show a battery, and the drones that it was in."""
        caller.must_be("operator", "provider")
        async with context.db.read() as connection:
            await providers.of_caller(connection, caller, provider_id=provider_id)
            return await battery_store.one(connection, provider_id, battery_id)

    @router.delete("/{battery_id}", status_code=204, responses=conflicts("BATTERY_INSTALLED"))
    async def delete_battery(
        provider_id: ProviderId,
        battery_id: BatteryId,
        caller: Annotated[Caller, Depends(context.gate)],
    ) -> Response:
        """Delete a battery that is in no drone."""
        caller.must_be("operator", "provider")
        async with context.db.write() as tx:
            await providers.of_caller(tx.connection, caller, provider_id=provider_id)
            await battery_store.delete_one(tx, provider_id, battery_id)
        return Response(status_code=204)

    return router


def installation_routes(context: Context) -> ServiceRouter:
    """PUT and DELETE /v1/providers/{provider_id}/drones/{drone_id}/battery."""
    router = ServiceRouter(tags=("drones",))
    path = "/v1/providers/{provider_id}/drones/{drone_id}/battery"

    @router.put(path, responses=conflicts("BATTERY_INSTALLED", "ON_MISSION", "OTHER_MODEL"))
    async def install_battery(
        provider_id: ProviderId,
        drone_id: DroneId,
        caller: Annotated[Caller, Depends(context.gate)],
        requested: BatteryChange,
    ) -> Drone:
        """Note that a drone has this battery now; its battery from before is in no drone."""
        caller.must_be("operator", "provider")
        of_drone = partial(store.of_caller, provider_id=provider_id, drone_id=drone_id)
        async with context.db.write() as tx:
            # Nothing else about the drone changes from here on.
            await touch(tx, drone_id)
            drone = await of_drone(tx.connection, caller)
            await battery_store.install(tx, drone, requested.battery_id, at=context.clock.now())
            drone = await of_drone(tx.connection, caller)
        return drone.shown(context.clock.wall_now())

    @router.delete(path, responses=conflicts("ON_MISSION"))
    async def remove_battery(
        provider_id: ProviderId, drone_id: DroneId, caller: Annotated[Caller, Depends(context.gate)]
    ) -> Drone:
        """Note that a drone does not have its registered battery any more."""
        caller.must_be("operator", "provider")
        of_drone = partial(store.of_caller, provider_id=provider_id, drone_id=drone_id)
        async with context.db.write() as tx:
            # Nothing else about the drone changes from here on.
            await touch(tx, drone_id)
            drone = await of_drone(tx.connection, caller)
            await battery_store.remove_from(tx, drone, at=context.clock.now())
            drone = await of_drone(tx.connection, caller)
        return drone.shown(context.clock.wall_now())

    return router


class MaintenanceRules(JsonModel):
    """The maintenance rules of a provider, by model."""

    items: tuple[ModelMaintenance, ...]


def maintenance_routes(context: Context) -> ServiceRouter:
    """/v1/providers/{provider_id}/maintenance-rules, and .../drones/{drone_id}/maintenance."""
    router = ServiceRouter(tags=("drones",), prefix="/v1/providers/{provider_id}")

    @router.get("/maintenance-rules")
    async def list_maintenance_rules(
        provider_id: ProviderId, caller: Annotated[Caller, Depends(context.gate)]
    ) -> MaintenanceRules:
        """List a provider's rules, by model."""
        caller.must_be("operator", "provider")
        async with context.db.read() as connection:
            await providers.of_caller(connection, caller, provider_id=provider_id)
            return MaintenanceRules(
                items=tuple(await maintenance_store.rules_of(connection, provider_id))
            )

    @router.put("/maintenance-rules/{model_id}")
    async def put_maintenance_rule(
        provider_id: ProviderId,
        model_id: DroneModelId,
        caller: Annotated[Caller, Depends(context.gate)],
        requested: MaintenanceRule,
    ) -> ModelMaintenance:
        """Set after how many hours or cycles the provider's drones of a model are due.

        What they have flown before counts too.
        """
        caller.must_be("operator", "provider")
        async with context.db.write() as tx:
            await providers.of_caller(tx.connection, caller, provider_id=provider_id)
            if model_id not in await store.usable_models(tx.connection, provider_id):
                raise InvalidInput(
                    "model_id", f"no drone model that you may use is called {model_id!r}"
                )
            await maintenance_store.put_rule(
                tx, provider_id, model_id, requested, at=context.clock.now()
            )
        return ModelMaintenance(model_id=model_id, **requested.model_dump())

    @router.delete("/maintenance-rules/{model_id}", status_code=204)
    async def delete_maintenance_rule(
        provider_id: ProviderId,
        model_id: DroneModelId,
        caller: Annotated[Caller, Depends(context.gate)],
    ) -> Response:
        """Remove the rule for a model; its drones are not due any more."""
        caller.must_be("operator", "provider")
        async with context.db.write() as tx:
            await providers.of_caller(tx.connection, caller, provider_id=provider_id)
            await maintenance_store.remove_rule(tx, provider_id, model_id, at=context.clock.now())
        return Response(status_code=204)

    @router.post("/drones/{drone_id}/maintenance")
    async def record_maintenance(
        provider_id: ProviderId, drone_id: DroneId, caller: Annotated[Caller, Depends(context.gate)]
    ) -> Drone:
        """Record that the maintenance of a drone was done: its counters begin at 0 again."""
        caller.must_be("operator", "provider")
        found = partial(store.of_caller, provider_id=provider_id, drone_id=drone_id)
        async with context.db.write() as tx:
            await found(tx.connection, caller)
            await maintenance_store.record_maintenance(tx, drone_id, at=context.clock.now())
            drone = await found(tx.connection, caller)
        return drone.shown(context.clock.wall_now())

    return router
