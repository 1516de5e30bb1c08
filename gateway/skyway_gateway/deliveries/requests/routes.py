"""Delivery requests and cancellations over REST."""

from collections.abc import Mapping
from typing import Annotated

from fastapi import Body, Depends, Request, Response
from pydantic import Discriminator, Tag

from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId
from skyway.runtime.http.answers import NOT_FOUND, IdempotencyKey, conflicts, response_of
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.service_router import ServiceRouter
from skyway_gateway.access.routes import KeyGate
from skyway_gateway.deliveries.lifecycle.customer_view import shown_to
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.requests.accept import Acceptance
from skyway_gateway.deliveries.requests.bodies import OfferChoice, RequestedDelivery
from skyway_gateway.deliveries.requests.cancel import Canceller, CancelRequest


def _form(body: object) -> str:
    """Which of the two forms a body has, so that complaints are about that one alone."""
    names = body if isinstance(body, Mapping) else ()
    return "an offer" if {"quote_id", "offer_id"} & set(names) else "a request"


RequestOrOffer = Annotated[
    Annotated[DeliveryRequest, Tag("a request")] | Annotated[OfferChoice, Tag("an offer")],
    Discriminator(_form),
]


def delivery_routes(*, gate: KeyGate, acceptance: Acceptance) -> ServiceRouter:
    """POST /v1/deliveries."""
    router = ServiceRouter(tags=("deliveries",))

    @router.post(
        "/v1/deliveries",
        status_code=202,
        response_model=RequestedDelivery,
        responses={
            **NOT_FOUND,
            **conflicts(
                "NO_NETWORK",
                "OFFER_LOST",
                "QUOTE_EXPIRED",
                "QUOTE_TAKEN",
                "TOO_MANY_DELIVERIES",
                "TOO_MANY_SCHEDULED",
            ),
        },
    )
    async def create_delivery(
        request: Request,
        caller: Annotated[Caller, Depends(gate)],
        wanted: Annotated[RequestOrOffer, Body()],
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Request a delivery, or accept an offer; it is booked and flown without further calls.

        Callers: customer, operator.
        """
        # An operator has stranded packages collected.
        caller.must_be("customer", "operator")
        answer = await acceptance.accept(
            caller,
            wanted,
            idempotency_key=idempotency_key,
            body=await request.body(),
            base_url=str(request.base_url),
        )
        return response_of(answer)

    return router


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
        cancelled = await canceller.cancel(caller, delivery_id, wanted or CancelRequest())
        return shown_to(caller, cancelled)

    return router
