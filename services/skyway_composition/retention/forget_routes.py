"""Deletes deliveries that ended long ago, when the gateway asks for it."""

from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends

from skyway.contracts.forgotten_deliveries import (
    FORGOTTEN_PATH,
    ForgetDeliveries,
    KeptDeliveries,
)
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.planning.no_show_store import COUNTED
from skyway_composition.retention import forget_store


@dataclass(frozen=True, slots=True)
class Forgetting:
    """Deletes deliveries in one transaction, except those that are still needed."""

    db: Database
    clock: FleetClock

    async def forget(self, asked: ForgetDeliveries) -> KeptDeliveries:
        """Delete them; a delivery that does not exist is deleted already."""
        blamed_ms = moment_to_ms(self.clock.now() - COUNTED)
        async with self.db.write() as tx:
            kept = await forget_store.needed_among(tx, asked.delivery_ids, blamed_ms=blamed_ms)
            await forget_store.delete_deliveries(tx, set(asked.delivery_ids) - kept)
        return KeptDeliveries(kept=tuple(sorted(kept)))


def forget_routes(*, gate: ServiceGate, forgetting: Forgetting) -> ServiceRouter:
    """POST /internal/deliveries/forgotten."""
    router = ServiceRouter(tags=("missions",))

    @router.post(FORGOTTEN_PATH)
    async def forget_deliveries(
        caller: Annotated[Caller, Depends(gate)],
        asked: Annotated[ForgetDeliveries, Depends(internal_body(ForgetDeliveries))],
    ) -> KeptDeliveries:
        """Delete deliveries that ended long ago; the answer names those that are kept."""
        caller.must_be_service("gateway")
        return await forgetting.forget(asked)

    return router
