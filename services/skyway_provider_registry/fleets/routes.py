"""Fleets over REST: providers register, see, count, change and remove their own drones."""

import asyncio
import json
from collections.abc import Mapping
from typing import Annotated

from fastapi import Depends, Query, Request, Response
from fastapi.exceptions import RequestValidationError

from skyway.cells import CellClients
from skyway.contracts.station_check import StationCheck
from skyway.drone.model import DroneModel
from skyway.ids import DroneId, DroneModelId, NetworkId, ProviderId
from skyway.runtime.errors import Conflict
from skyway.runtime.http.answers import IdempotencyKey, conflicts, keyed_call, response_of
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.idempotency_store import Answer, once
from skyway.runtime.signing.cloud_key_file import CloudKeyFile
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_provider_registry.context import Context
from skyway_provider_registry.enrolment import credential_store
from skyway_provider_registry.enrolment.password_file import PasswordFile
from skyway_provider_registry.fleets import battery_store, statistics_store, store
from skyway_provider_registry.fleets.drone import (
    Drone,
    DroneChange,
    NewDrone,
    RegisteredDrone,
)
from skyway_provider_registry.fleets.quota_store import DroneLimit
from skyway_provider_registry.fleets.registration import (
    PreparedDrones,
    RegisteredDrones,
    RegistrationFault,
    changed_columns,
    faults_of,
    prepare,
    store_drones,
    taken_faults,
)
from skyway_provider_registry.fleets.registration_forms import GOOD_DRY_RUN, DryRun, OneOrMany
from skyway_provider_registry.fleets.statistics_store import FleetStatistics, totals
from skyway_provider_registry.fleets.store import usable_models
from skyway_provider_registry.homes import StationLookup
from skyway_provider_registry.presence import learned_store
from skyway_provider_registry.presence.drone_presence import SILENCE
from skyway_provider_registry.presence.store import touch
from skyway_provider_registry.providers import store as providers


def fleet_routes(
    context: Context, *, stations: StationLookup, password_file: PasswordFile, servers: CellClients
) -> ServiceRouter:
    """GET, PATCH and DELETE of /v1/providers/{provider_id}/drones and /{drone_id}."""
    router = ServiceRouter(tags=("drones",), prefix="/v1/providers/{provider_id}/drones")

    @router.get("")
    async def list_drones(
        provider_id: ProviderId,
        caller: Annotated[Caller, Depends(context.gate)],
        query: Annotated[PageQuery, Query()],
    ) -> Page[Drone]:
        """List the drones of a provider, by id."""
        caller.must_be("operator", "provider")
        async with context.db.read() as connection:
            await providers.of_caller(connection, caller, provider_id=provider_id)
            drones = await store.page_of_caller(
                connection, caller, provider_id=provider_id, query=query
            )
        wall_now = context.clock.wall_now()
        return page_of(
            drones,
            query,
            item=lambda drone: drone.shown(wall_now),
            sort_key=lambda drone: (drone.drone_id,),
        )

    @router.get("/{drone_id}")
    async def get_drone(
        provider_id: ProviderId, drone_id: DroneId, caller: Annotated[Caller, Depends(context.gate)]
    ) -> Drone:
        """Show a drone and its present state; a drone sees itself."""
        caller.must_be("operator", "provider", "drone")
        async with context.db.read() as connection:
            drone = await store.of_caller(
                connection, caller, provider_id=provider_id, drone_id=drone_id
            )
        return drone.shown(context.clock.wall_now())

    @router.patch("/{drone_id}", responses=conflicts("OTHER_CELL", "REGISTRATION_TAKEN"))
    async def update_drone(
        provider_id: ProviderId,
        drone_id: DroneId,
        caller: Annotated[Caller, Depends(context.gate)],
        requested: DroneChange,
    ) -> Drone:
        """Change a drone's own data, or take it out of service and back."""
        caller.must_be("operator", "provider")
        async with context.db.read() as connection:
            provider = await providers.of_caller(connection, caller, provider_id=provider_id)
            drone = await store.of_caller(
                connection, caller, provider_id=provider_id, drone_id=drone_id
            )
        values = await changed_columns(
            requested, stations, model=drone.model, tariff=provider.tariff
        )
        async with context.db.write() as tx:
            if "network_id" in values:
                before = await store.of_caller(
                    tx.connection, caller, provider_id=provider_id, drone_id=drone_id
                )
                home = NetworkId(str(values["network_id"]))
                if servers.url_of(before.network_id) != servers.url_of(home):
                    detail = (
                        f"the drone is at home in {before.network_id}, and another composition "
                        f"serves {home}: remove the drone, and register it again"
                    )
                    raise Conflict("OTHER_CELL", detail)
            await store.change(
                tx, caller, provider_id=provider_id, drone_id=drone_id, values=values
            )
            drone = await store.of_caller(
                tx.connection, caller, provider_id=provider_id, drone_id=drone_id
            )
        return drone.shown(context.clock.wall_now())

    @router.delete("/{drone_id}/learned-values", status_code=204)
    async def forget_learned_values(
        provider_id: ProviderId, drone_id: DroneId, caller: Annotated[Caller, Depends(context.gate)]
    ) -> Response:
        """Forget what flights have shown about a drone; its registered battery keeps its health."""
        caller.must_be("operator", "provider")
        async with context.db.write() as tx:
            await store.change(tx, caller, provider_id=provider_id, drone_id=drone_id, values={})
            await learned_store.forget(tx, drone_id)
        return Response(status_code=204)

    @router.delete("/{drone_id}", status_code=204, responses=conflicts("ON_MISSION"))
    async def delete_drone(
        provider_id: ProviderId, drone_id: DroneId, caller: Annotated[Caller, Depends(context.gate)]
    ) -> Response:
        """Remove a drone that is on no mission, and its broker account."""
        caller.must_be("operator", "provider")
        async with context.db.write() as tx:
            await touch(tx, drone_id)
            drone = await store.of_caller(
                tx.connection, caller, provider_id=provider_id, drone_id=drone_id
            )
            battery_store.refuse_on_mission(drone)
            await battery_store.free(tx, drone_id, at=context.clock.now())
            await credential_store.remove_keys(tx, drone_id, at=context.clock.wall_now())
            await store.remove(tx, caller, provider_id=provider_id, drone_id=drone_id)
            await credential_store.remove_account(tx, drone_id)
        await password_file.refresh()
        return Response(status_code=204)

    return router


def fleet_statistics_routes(context: Context) -> ServiceRouter:
    """GET /v1/stats/fleets."""
    router = ServiceRouter(tags=("statistics",))

    @router.get("/v1/stats/fleets")
    async def get_fleet_statistics(
        caller: Annotated[Caller, Depends(context.gate)],
    ) -> FleetStatistics:
        """Count the drones in each state, and measure how late their messages arrive.

        Also shows when the next busy drone is free.
        """
        caller.must_be("provider", "operator")
        provider_id = ProviderId(caller.subject_id) if caller.role == "provider" else None
        now, since_ms = context.clock.now(), moment_to_ms(context.clock.wall_now() - SILENCE)
        async with context.db.read() as connection:
            rows = await statistics_store.groups(
                connection, provider_id, received_since_wall_ms=since_ms
            )
            next_free_ms = await statistics_store.next_free_ms(
                connection, provider_id, now_ms=moment_to_ms(now)
            )
        return totals(rows, at=now, rate=context.clock.rate, next_free_ms=next_free_ms)

    return router


NewDrones = OneOrMany[NewDrone]


def registration_routes(
    context: Context,
    *,
    stations: StationLookup,
    password_file: PasswordFile,
    limit: DroneLimit,
    cloud_keys: CloudKeyFile,
) -> ServiceRouter:
    """POST /v1/providers/{provider_id}/drones."""
    router = ServiceRouter(tags=("drones",))

    async def checked(
        new_drones: list[NewDrone], *, caller: Caller, provider_id: ProviderId, raw: bytes
    ) -> tuple[Mapping[DroneModelId, DroneModel], StationCheck]:
        async with context.db.read() as connection:
            provider = await providers.of_caller(connection, caller, provider_id=provider_id)
            models = await usable_models(connection, provider_id)
        check = await stations.check(drone.home_station_id for drone in new_drones)
        faults = faults_of(new_drones, models=models, tariff=provider.tariff, check=check)
        _refuse(faults, raw=raw)
        return models, check

    async def prepared(
        new_drones: list[NewDrone], *, caller: Caller, provider_id: ProviderId, raw: bytes
    ) -> PreparedDrones:
        models, check = await checked(new_drones, caller=caller, provider_id=provider_id, raw=raw)
        # In a thread: preparing 500 drones would hold up the event loop.
        return await asyncio.to_thread(
            prepare,
            new_drones,
            provider_id=provider_id,
            models=models,
            stations=check,
            mint=context.mint,
            clock=context.clock,
            cloud_keys=cloud_keys.read(),
            hash_password=password_file.hash_password,
        )

    @router.post(
        "/v1/providers/{provider_id}/drones",
        status_code=201,
        response_model=RegisteredDrone | RegisteredDrones,
        responses={
            **conflicts(
                "NO_NETWORK", "PROVIDER_SUSPENDED", "REGISTRATION_TAKEN", "TOO_MANY_DRONES"
            ),
            **GOOD_DRY_RUN,
        },
    )
    async def register_drones(
        provider_id: ProviderId,
        request: Request,
        caller: Annotated[Caller, Depends(context.gate)],
        wanted: NewDrones,
        query: Annotated[DryRun, Query()],
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Register one drone or a list of drones, all or none.

        `enrolment_token` and `mqtt` are shown only in this answer.
        """
        caller.must_be("operator", "provider")
        raw = await request.body()
        new_drones = wanted if isinstance(wanted, list) else [wanted]
        if query.dry_run:
            await checked(new_drones, caller=caller, provider_id=provider_id, raw=raw)
            async with context.db.read() as connection:
                await limit.must_allow(connection, provider_id, caller, new=len(new_drones))
                taken = await store.taken_registrations(connection, provider_id, new_drones)
            _refuse(taken_faults(new_drones, taken), raw=raw)
            return Response(status_code=204)
        ready = await prepared(new_drones, caller=caller, provider_id=provider_id, raw=raw)
        form = _answer_of_list if isinstance(wanted, list) else _answer_of_one
        answer = await asyncio.to_thread(form, ready)

        async def act(tx: Tx) -> Answer:
            await limit.must_allow(tx.connection, provider_id, caller, new=len(new_drones))
            await store_drones(tx, ready)
            return answer

        call = await keyed_call(request, caller, idempotency_key)
        given = await once(context.db, call, act=act, clock=context.clock)
        await password_file.refresh()
        return response_of(given)

    return router


def _refuse(faults: list[RegistrationFault], *, raw: bytes) -> None:
    """Answer faults in the form of validation errors, each with its place in the body."""
    if not faults:
        return
    body = json.loads(raw)
    complaints = [
        {
            "type": "invalid_drone",
            "loc": ("body", *([fault.index] if isinstance(body, list) else []), fault.field),
            "msg": fault.detail,
        }
        for fault in faults
    ]
    raise RequestValidationError(complaints, body=body)


def _answer_of_one(ready: PreparedDrones) -> Answer:
    drone = ready.shown[0]
    location = f"/v1/providers/{drone.provider_id}/drones/{drone.drone_id}"
    return Answer(201, drone.model_dump_json().encode(), {"Location": location})


def _answer_of_list(ready: PreparedDrones) -> Answer:
    return Answer(201, RegisteredDrones(items=ready.shown).model_dump_json().encode())
