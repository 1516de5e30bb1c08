"""The gateway opens and closes people's broker accounts, and looks up the keys of drones."""

from dataclasses import dataclass
from typing import Annotated, Final

from fastapi import Depends, Response
from pydantic import Field

from skyway.contracts.broker_rules import (
    DEPLOYMENT_OPERATOR,
    SERVICE_ACCOUNTS,
    operator_account,
)
from skyway.contracts.drones import (
    DRONE_SIGNATURES,
    DroneKeyAnswer,
    DroneKeyQuery,
    DroneSignatureQuery,
    DroneSignatures,
)
from skyway.errors import InvalidInput
from skyway.ids import SubjectId
from skyway.json_model import WireModel
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_provider_registry.change_store import RenewalMoment
from skyway_provider_registry.context import Context
from skyway_provider_registry.enrolment import credential_store
from skyway_provider_registry.enrolment.credential_store import PersonKind
from skyway_provider_registry.enrolment.password_file import PasswordFile
from skyway_provider_registry.enrolment.signing_store import StoredKeys

#: Names of Skyway's own processes, which a customer must not have.
_RESERVED: Final = SERVICE_ACCOUNTS | {"operator"}

#: Prefix of drone ids: a customer with such a name could act as a drone.
_DRONE_PREFIX: Final = "drn_"


class BrokerPassword(WireModel):
    """The password of a customer's or an operator's broker account."""

    password: Annotated[str, Field(min_length=16, max_length=72, description="16 to 72 characters")]


@dataclass(frozen=True, slots=True)
class _People:
    """Opens and closes the accounts of people, in the database and in the broker's files."""

    db: Database
    password_file: PasswordFile

    async def open(self, kind: PersonKind, user_name: str, password: BrokerPassword) -> Response:
        hashed = self.password_file.hash_password(password.password)
        async with self.db.write() as tx:
            await credential_store.put_person(tx, kind, user_name, password_hash=hashed)
        await self.password_file.refresh()
        return Response(status_code=204)

    async def close(self, kind: PersonKind, user_name: str) -> Response:
        async with self.db.write() as tx:
            await credential_store.remove_person(tx, kind, user_name)
        await self.password_file.refresh()
        return Response(status_code=204)


def enrolment_routes(context: Context, *, password_file: PasswordFile) -> ServiceRouter:
    """PUT and DELETE of /internal/broker-accounts/... and /internal/operator-accounts/..."""
    router = ServiceRouter(tags=("internal",))
    people = _People(context.db, password_file)

    @router.put("/internal/broker-accounts/{user_name}", status_code=204)
    async def put_broker_account(
        user_name: SubjectId,
        caller: Annotated[Caller, Depends(context.gate)],
        requested: Annotated[BrokerPassword, Depends(internal_body(BrokerPassword))],
    ) -> Response:
        """Open a customer's broker account, or give it another password."""
        caller.must_be_service("gateway")
        _refuse_reserved(user_name)
        return await people.open("CUSTOMER", user_name, requested)

    @router.delete("/internal/broker-accounts/{user_name}", status_code=204)
    async def delete_broker_account(
        user_name: SubjectId, caller: Annotated[Caller, Depends(context.gate)]
    ) -> Response:
        """Close a customer's broker account."""
        caller.must_be_service("gateway")
        _refuse_reserved(user_name)
        return await people.close("CUSTOMER", user_name)

    @router.put("/internal/operator-accounts/{name}", status_code=204)
    async def put_operator_account(
        name: SubjectId,
        caller: Annotated[Caller, Depends(context.gate)],
        requested: Annotated[BrokerPassword, Depends(internal_body(BrokerPassword))],
    ) -> Response:
        """Open an operator's broker account, or give it another password."""
        caller.must_be_service("gateway")
        return await people.open("OPERATOR", _operator(name), requested)

    @router.delete("/internal/operator-accounts/{name}", status_code=204)
    async def delete_operator_account(
        name: SubjectId, caller: Annotated[Caller, Depends(context.gate)]
    ) -> Response:
        """Close an operator's broker account."""
        caller.must_be_service("gateway")
        return await people.close("OPERATOR", _operator(name))

    return router


def _refuse_reserved(user_name: SubjectId) -> None:
    if user_name in _RESERVED or user_name.startswith(_DRONE_PREFIX):
        raise InvalidInput("user_name", f"{user_name!r} is reserved for Skyway's own processes")


def _operator(name: SubjectId) -> str:
    user_name = operator_account(name)
    if user_name == DEPLOYMENT_OPERATOR:
        raise InvalidInput("name", f"{name!r} is reserved for the deployment's own account")
    return user_name


def drone_key_routes(context: Context, *, password_file: PasswordFile) -> ServiceRouter:
    """POST /internal/drone-keys."""
    router = ServiceRouter(tags=("internal",))

    @router.post("/internal/drone-keys")
    async def find_drone_key(
        caller: Annotated[Caller, Depends(context.gate)],
        query: Annotated[DroneKeyQuery, Depends(internal_body(DroneKeyQuery))],
    ) -> DroneKeyAnswer:
        """Whose key this is; the first use of a rotated one ends the one before."""
        caller.must_be_service("gateway")
        async with context.db.read() as connection:
            found = await credential_store.shown_key(connection, query.key_hash)
        if found is None:
            return DroneKeyAnswer(drone_id=None)
        if found.is_next:
            async with context.db.write() as tx:
                moment = RenewalMoment(at=context.clock.now(), wall_at=context.clock.wall_now())
                await credential_store.bring_into_force(tx, query.key_hash, moment)
            await password_file.refresh()
        return DroneKeyAnswer(drone_id=found.drone_id)

    return router


def drone_signature_routes(context: Context, *, keys: StoredKeys) -> ServiceRouter:
    """POST /internal/drone-signatures."""
    router = ServiceRouter(tags=("internal",))

    @router.post(DRONE_SIGNATURES)
    async def find_drone_signatures(
        caller: Annotated[Caller, Depends(context.gate)],
        query: Annotated[DroneSignatureQuery, Depends(internal_body(DroneSignatureQuery))],
    ) -> DroneSignatures:
        """How these drones sign; without any, those whose credentials have just changed."""
        caller.must_be_service("composition")
        found = await keys.of(query.drone_ids) if query.drone_ids else await keys.changed()
        return DroneSignatures(signatures=tuple(found))

    return router
