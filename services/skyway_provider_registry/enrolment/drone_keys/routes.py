"""The gateway asks whose a drone's key is."""

from typing import Annotated

from fastapi import Depends

from skyway.contracts.drone_key import DroneKeyAnswer, DroneKeyQuery
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_provider_registry.enrolment.drone_keys import store
from skyway_provider_registry.enrolment.password_file import PasswordFile


def drone_key_routes(
    *, db: Database, gate: ServiceGate, password_file: PasswordFile
) -> ServiceRouter:
    """POST /internal/drone-keys."""
    router = ServiceRouter(tags=("internal",))

    @router.post("/internal/drone-keys")
    async def find_drone_key(
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[DroneKeyQuery, Depends(internal_body(DroneKeyQuery))],
    ) -> DroneKeyAnswer:
        """Whose key this is; the first use of a rotated one ends the one before."""
        caller.must_be("service")
        async with db.read() as connection:
            found = await store.shown(connection, query.key_hash)
        if found is None:
            return DroneKeyAnswer(drone_id=None)
        if found.is_next:
            async with db.write() as tx:
                await store.bring_into_force(tx, query.key_hash)
            await password_file.refresh()
        return DroneKeyAnswer(drone_id=found.drone_id)

    return router
