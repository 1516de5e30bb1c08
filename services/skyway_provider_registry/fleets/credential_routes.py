"""Credentials of drones over REST: the drone exchanges and rotates, its provider revokes."""

from collections.abc import Awaitable, Callable
from typing import Annotated

from fastapi import Depends, Request, Response

from skyway.ids import DroneId, ProviderId
from skyway.json_model import JsonModel
from skyway.runtime.http.answers import IdempotencyKey, conflicts, keyed_call, response_of
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.idempotency_store import Answer, once
from skyway.runtime.peer_secrets import secret_hash
from skyway.runtime.sql.database import Tx
from skyway_provider_registry.change_store import RenewalMoment
from skyway_provider_registry.context import Context
from skyway_provider_registry.enrolment import credential_store
from skyway_provider_registry.enrolment.password_file import PasswordFile
from skyway_provider_registry.fleets import store
from skyway_provider_registry.fleets.issue_credentials import (
    Credentials,
    Enrolment,
    EnrolmentRequest,
    IssuedToken,
    Issuer,
    RotationRequest,
    enrol,
    issue_token,
    revoke,
    rotate,
)

_DRONE = "/v1/providers/{provider_id}/drones/{drone_id}"


def credential_routes(
    context: Context, *, password_file: PasswordFile, issuer: Issuer
) -> ServiceRouter:
    """POST /v1/enrolments and /rotations, a drone's enrolment tokens, DELETE of credentials."""
    router = ServiceRouter(tags=("enrolment",))

    def now() -> RenewalMoment:
        return RenewalMoment(at=context.clock.now(), wall_at=context.clock.wall_now())

    async def answer_once(
        request: Request,
        asked_by: str,
        key: str | None,
        act: Callable[[Tx], Awaitable[JsonModel]],
    ) -> Response:
        async def shown(tx: Tx) -> Answer:
            return Answer(201, (await act(tx)).model_dump_json().encode())

        call = await keyed_call(request, asked_by, key)
        return response_of(await once(context.db, call, act=shown, clock=context.clock))

    @router.post(
        "/v1/enrolments",
        status_code=201,
        response_model=Enrolment,
        responses=conflicts("TOKEN_EXPIRED", "TOKEN_USED"),
    )
    async def enrol_drone(
        request: Request,
        caller: Annotated[Caller, Depends(context.gate)],
        requested: EnrolmentRequest,
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Exchange an enrolment token for a drone's credentials, once.

        With an Idempotency-Key a lost answer can be asked for again.
        """
        caller.must_be_service("gateway")

        hashed = secret_hash(requested.enrolment_token)
        async with context.db.read() as connection:
            await credential_store.require_token(connection, hashed)

        async def act(tx: Tx) -> Enrolment:
            return await enrol(tx, requested, issuer=issuer, moment=now())

        # All drones enrol by way of the gateway: the key counts for this token only.
        answer = await answer_once(request, f"token:{hashed}", idempotency_key, act)
        await password_file.refresh()
        return answer

    @router.post("/v1/enrolments/rotations", status_code=201, response_model=Credentials)
    async def rotate_drone_credentials(
        request: Request,
        caller: Annotated[Caller, Depends(context.gate)],
        requested: RotationRequest | None = None,
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Give the calling drone new credentials.

        The old credentials stop when the new key is first used.
        """
        caller.must_be("drone")

        async def act(tx: Tx) -> Credentials:
            own = requested or RotationRequest()
            drone_id = DroneId(caller.subject_id)
            return await rotate(tx, drone_id, own, issuer=issuer, wall_now=context.clock.wall_now())

        return await answer_once(request, str(caller), idempotency_key, act)

    @router.post(f"{_DRONE}/enrolment-tokens", status_code=201, response_model=IssuedToken)
    async def create_enrolment_token(
        provider_id: ProviderId,
        drone_id: DroneId,
        request: Request,
        caller: Annotated[Caller, Depends(context.gate)],
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Make another enrolment token; the token before stops, the drone's credentials do not."""
        caller.must_be("operator", "provider")

        async def act(tx: Tx) -> IssuedToken:
            await store.of_caller(tx.connection, caller, provider_id=provider_id, drone_id=drone_id)
            return await issue_token(tx, drone_id, wall_now=context.clock.wall_now())

        return await answer_once(request, str(caller), idempotency_key, act)

    @router.delete(f"{_DRONE}/credentials", status_code=204)
    async def revoke_drone_credentials(
        provider_id: ProviderId, drone_id: DroneId, caller: Annotated[Caller, Depends(context.gate)]
    ) -> Response:
        """Refuse a drone's credentials from now on; it may enrol again with another token."""
        caller.must_be("operator", "provider")
        async with context.db.write() as tx:
            await store.of_caller(tx.connection, caller, provider_id=provider_id, drone_id=drone_id)
            await revoke(tx, drone_id, now())
        await password_file.refresh()
        return Response(status_code=204)

    return router
