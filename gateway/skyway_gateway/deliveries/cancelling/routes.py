"""Cancelling deliveries over REST."""

from typing import Annotated

from fastapi import Body, Depends

from skyway.ids import DeliveryId
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.problem_answers import conflicts
from skyway.runtime.http.service_router import ServiceRouter
from skyway_gateway.access.routes import KeyGate
from skyway_gateway.deliveries.cancelling.cancel import Canceller
from skyway_gateway.deliveries.cancelling.cancel_request import CancelRequest
from skyway_gateway.deliveries.lifecycle.delivery import Delivery


def cancelling_routes(*, gate: KeyGate, canceller: Canceller) -> ServiceRouter:
    """POST /v1/deliveries/{delivery_id}/cancel."""
    router = ServiceRouter(tags=("deliveries",))

    @router.post("/v1/deliveries/{delivery_id}/cancel", responses=conflicts("TOO_LATE"))
    async def cancel_delivery(
        delivery_id: DeliveryId,
        caller: Annotated[Caller, Depends(gate)],
        wanted: Annotated[CancelRequest | None, Body()] = None,
    ) -> Delivery:
        """Cancel a delivery, or some of its packages.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        return await canceller.cancel(caller, delivery_id, wanted or CancelRequest())

    return router
