"""POST of drones: one drone, or a whole fleet in one call."""

import asyncio
import json
from typing import Annotated, Final

from fastapi import Depends, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import Discriminator, Field, Tag

from skyway.ids import ProviderId
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.idempotency_key import IdempotencyKey, response_of
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.problem_answers import conflicts
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.idempotency.once import Answer, once
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway_provider_registry.enrolment.password_file import PasswordFile
from skyway_provider_registry.fleets import drone_model_store as drone_models
from skyway_provider_registry.fleets.drone import (
    MAX_NEW_DRONES,
    NewDrone,
    RegisteredDrone,
    RegisteredDrones,
)
from skyway_provider_registry.fleets.registration import (
    PreparedDrones,
    RegistrationFault,
    StationLookup,
    faults_of,
    prepare,
    store_drones,
)
from skyway_provider_registry.providers import store as providers

#: Bytes of a list of drones (docs/reference/rest.md); a drone takes about 200.
REGISTRATION_LIMIT_BYTES: Final = 8 * 1024 * 1024


def _form_of(body: object) -> str:
    return "list" if isinstance(body, list) else "object"


#: One drone, or a whole fleet in one call.
NewDrones = Annotated[
    Annotated[NewDrone, Tag("object")]
    | Annotated[list[NewDrone], Field(min_length=1, max_length=MAX_NEW_DRONES), Tag("list")],
    Discriminator(_form_of),
]


def registration_routes(
    *,
    db: Database,
    gate: ServiceGate,
    clock: FleetClock,
    mint: Mint,
    stations: StationLookup,
    password_file: PasswordFile,
) -> ServiceRouter:
    """POST /v1/providers/{provider_id}/drones."""
    router = ServiceRouter(tags=("drones",))

    async def prepared(
        new_drones: list[NewDrone], *, caller: Caller, provider_id: ProviderId, raw: bytes
    ) -> PreparedDrones:
        async with db.read() as connection:
            await providers.of_caller(connection, caller, provider_id=provider_id)
            models = await drone_models.every(connection)
        check = await stations.check(drone.home_station_id for drone in new_drones)
        faults = faults_of(new_drones, models=models, unknown_stations=set(check.unknown))
        _refuse(faults, raw=raw)
        # In a thread: the passwords of 5,000 drones take 0.3 s of hashing.
        return await asyncio.to_thread(
            prepare,
            new_drones,
            provider_id=provider_id,
            models=models,
            stations=check,
            mint=mint,
            clock=clock,
        )

    @router.post(
        "/v1/providers/{provider_id}/drones",
        status_code=201,
        response_model=RegisteredDrone | RegisteredDrones,
        responses=conflicts("NO_NETWORK", "REGISTRATION_TAKEN"),
    )
    async def register_drones(
        provider_id: ProviderId,
        request: Request,
        caller: Annotated[Caller, Depends(gate)],
        wanted: NewDrones,
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Register one drone or a list of drones, all or none.

        `enrolment_token` and `mqtt` are shown only in this answer.
        """
        caller.must_be("operator", "provider")
        raw = await request.body()
        new_drones = wanted if isinstance(wanted, list) else [wanted]
        ready = await prepared(new_drones, caller=caller, provider_id=provider_id, raw=raw)
        form = _answer_of_list if isinstance(wanted, list) else _answer_of_one
        answer = await asyncio.to_thread(form, ready)

        async def act(tx: Tx) -> Answer:
            await store_drones(tx, ready)
            return answer

        given = await once(
            db,
            caller=str(caller),
            route=f"POST /v1/providers/{provider_id}/drones",
            key=idempotency_key,
            body=raw,
            act=act,
            clock=clock,
        )
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
