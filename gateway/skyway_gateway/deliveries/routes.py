"""Deliveries over REST: requested and cancelled by customers, reported on by composition."""

from collections.abc import Mapping
from typing import Annotated

from fastapi import Body, Depends, Request, Response
from pydantic import Discriminator, Tag

from skyway.contracts.mission import MissionReport
from skyway.contracts.mission_reports import (
    MANY_MISSION_REPORTS,
    MISSION_REPORTS,
    MissionReports,
)
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.repeatable import IdempotencyKey, response_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway_gateway.access.routes import KeyGate
from skyway_gateway.deliveries.accept import Acceptance, OfferChoice
from skyway_gateway.deliveries.cancel import Canceller, CancelRequest
from skyway_gateway.deliveries.delivery import Delivery
from skyway_gateway.deliveries.follow import Follower


def _form(body: object) -> str:
    """Which of the two forms a body has, so that complaints are about that one alone."""
    names = body if isinstance(body, Mapping) else ()
    return "an offer" if {"quote_id", "offer_id"} & set(names) else "a request"


RequestOrOffer = Annotated[
    Annotated[DeliveryRequest, Tag("a request")] | Annotated[OfferChoice, Tag("an offer")],
    Discriminator(_form),
]


def delivery_routes(
    *, gate: KeyGate, acceptance: Acceptance, canceller: Canceller
) -> ServiceRouter:
    """POST /v1/deliveries, and what a customer changes of them later."""
    router = ServiceRouter(tags=("deliveries",))

    @router.post("/v1/deliveries", status_code=202, response_model=Delivery)
    async def request_delivery(
        request: Request,
        caller: Annotated[Caller, Depends(gate)],
        wanted: Annotated[RequestOrOffer, Body()],
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Request a delivery, or take an offer; it is booked and flown without further calls."""
        # An operator has stranded packages collected.
        caller.must_be("customer", "operator")
        answer = await acceptance.accept(
            caller, wanted, idempotency_key=idempotency_key, body=await request.body()
        )
        return response_of(answer)

    @router.post("/v1/deliveries/{delivery_id}/cancel")
    async def cancel_delivery(
        delivery_id: DeliveryId,
        caller: Annotated[Caller, Depends(gate)],
        wanted: Annotated[CancelRequest | None, Body()] = None,
    ) -> Delivery:
        """Cancel a delivery, or some of its packages; 409 TOO_LATE when nothing can be stopped."""
        caller.must_be("customer", "operator")
        return await canceller.cancel(caller, delivery_id, wanted or CancelRequest())

    return router


def report_routes(*, gate: ServiceGate, follower: Follower) -> ServiceRouter:
    """POST /internal/mission-reports and /internal/mission-reports/many."""
    router = ServiceRouter(tags=("internal",))

    @router.post(MISSION_REPORTS, status_code=204)
    async def take_report(
        caller: Annotated[Caller, Depends(gate)],
        report: Annotated[MissionReport, Depends(internal_body(MissionReport))],
    ) -> Response:
        """Take one report of a mission; 409 NOT_YET asks for it again later."""
        caller.must_be("service")
        await follower.follow(report)
        return Response(status_code=204)

    @router.post(MANY_MISSION_REPORTS, status_code=204)
    async def take_reports(
        caller: Annotated[Caller, Depends(gate)],
        reports: Annotated[MissionReports, Depends(internal_body(MissionReports))],
    ) -> Response:
        """Take reports of several missions; the first that is refused refuses those after it."""
        caller.must_be("service")
        await follower.follow_all(reports.reports)
        return Response(status_code=204)

    return router
