"""The gateway opens and closes customers' broker accounts, and looks up the keys of drones."""

from typing import Annotated

from fastapi import Depends, Response
from pydantic import Field

from skyway.broker_setup.passwords import hash_password
from skyway.contracts.drone_key import DroneKeyAnswer, DroneKeyQuery
from skyway.errors import InvalidInput
from skyway.ids import SubjectId
from skyway.json_model import WireModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_provider_registry.enrolment import credential_store
from skyway_provider_registry.enrolment.password_file import DEPLOYMENT_USERS, PasswordFile
from skyway_provider_registry.renewal_store import RenewalMoment

#: Prefix of drone ids: a customer with such a name could act as a drone.
_DRONE_PREFIX = "drn_"


class BrokerPassword(WireModel):
    """The password of a customer's broker account."""

    password: Annotated[
        str, Field(min_length=16, max_length=200, description="16 to 200 characters")
    ]


def enrolment_routes(
    *, db: Database, gate: ServiceGate, password_file: PasswordFile
) -> ServiceRouter:
    """PUT and DELETE /internal/broker-accounts/{user_name}."""
    router = ServiceRouter(tags=("internal",))

    @router.put("/internal/broker-accounts/{user_name}", status_code=204)
    async def put_broker_account(
        user_name: SubjectId,
        caller: Annotated[Caller, Depends(gate)],
        requested: Annotated[BrokerPassword, Depends(internal_body(BrokerPassword))],
    ) -> Response:
        """Open a customer's broker account, or give it another password."""
        caller.must_be_service("gateway")
        _refuse_reserved(user_name)
        async with db.write() as tx:
            await credential_store.put_customer(
                tx, user_name, password_hash=hash_password(requested.password)
            )
        await password_file.refresh()
        return Response(status_code=204)

    @router.delete("/internal/broker-accounts/{user_name}", status_code=204)
    async def delete_broker_account(
        user_name: SubjectId, caller: Annotated[Caller, Depends(gate)]
    ) -> Response:
        """Close a customer's broker account."""
        caller.must_be_service("gateway")
        _refuse_reserved(user_name)
        async with db.write() as tx:
            await credential_store.remove_customer(tx, user_name)
        await password_file.refresh()
        return Response(status_code=204)

    return router


def _refuse_reserved(user_name: SubjectId) -> None:
    if user_name in DEPLOYMENT_USERS or user_name.startswith(_DRONE_PREFIX):
        raise InvalidInput("user_name", f"{user_name!r} is reserved for Skyway's own processes")


def drone_key_routes(
    *, db: Database, gate: ServiceGate, clock: FleetClock, password_file: PasswordFile
) -> ServiceRouter:
    """POST /internal/drone-keys."""
    router = ServiceRouter(tags=("internal",))

    @router.post("/internal/drone-keys")
    async def find_drone_key(
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[DroneKeyQuery, Depends(internal_body(DroneKeyQuery))],
    ) -> DroneKeyAnswer:
        """Whose key this is; the first use of a rotated one ends the one before."""
        caller.must_be_service("gateway")
        async with db.read() as connection:
            found = await credential_store.shown_key(connection, query.key_hash)
        if found is None:
            return DroneKeyAnswer(drone_id=None)
        if found.is_next:
            async with db.write() as tx:
                moment = RenewalMoment(at=clock.now(), wall_at=clock.wall_now())
                await credential_store.bring_into_force(tx, query.key_hash, moment)
            await password_file.refresh()
        return DroneKeyAnswer(drone_id=found.drone_id)

    return router
