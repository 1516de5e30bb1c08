"""Delivery requests, cancellations, and the mission reports of composition over REST."""

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated

from fastapi import Body, Depends, Request, Response
from pydantic import Discriminator, Tag

from skyway.contracts.mission_reports import (
    MANY_MISSION_REPORTS,
    MISSION_REPORTS,
    MissionReport,
    MissionReports,
)
from skyway.ids import DeliveryId
from skyway.runtime.http.answers import (
    NOT_FOUND,
    IdempotencyKey,
    conflicts,
    keyed_call,
    response_of,
)
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.request_boundary import Admission
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.replicas.membership import Membership
from skyway_gateway.access.routes import KeyCaller, holder_of
from skyway_gateway.deliveries.apply_reports import ReportApplier
from skyway_gateway.deliveries.booking.run_bookings import BookingLoop
from skyway_gateway.deliveries.lifecycle.customer_forms import (
    NewDelivery,
    OfferChoice,
    RequestedDelivery,
    ShownDelivery,
    shown_to,
)
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.requests.accept import Acceptance
from skyway_gateway.deliveries.requests.cancel import Canceller, CancelRequest
from skyway_gateway.deliveries.requests.change import Changer, ErasedPersonalData
from skyway_gateway.deliveries.requests.change_form import DeliveryChange
from skyway_gateway.livemode import ByMode


def _form(body: object) -> str:
    """Which of the two forms a body has, so that complaints are about that one alone."""
    names = body if isinstance(body, Mapping) else ()
    return "an offer" if {"quote_id", "offer_id"} & set(names) else "a request"


RequestOrOffer = Annotated[
    Annotated[NewDelivery, Tag("a request")] | Annotated[OfferChoice, Tag("an offer")],
    Discriminator(_form),
]


def shedding(entrance: Admission, booking: BookingLoop, replicas: Membership) -> Admission:
    """The entrance that first refuses new delivery requests while there is no room for them.

    Such a refusal looks up no key and reads no body: many refusals must cost little.
    """

    async def admit(request: Request) -> Mapping[str, str]:
        if request.method == "POST" and request.scope["path"] == "/v1/deliveries":
            booking.must_have_room(replicas=replicas.alive)
        return await entrance(request=request)

    return admit


def delivery_routes(
    *, acceptances: ByMode[Acceptance], canceller: Canceller, changers: ByMode[Changer]
) -> ServiceRouter:
    """POST /v1/deliveries, and all calls that change a delivery."""
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
        caller: KeyCaller,
        wanted: Annotated[RequestOrOffer, Body()],
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Request a delivery, or accept an offer; it is booked and flown without further calls.

        Callers: customer, operator.
        """
        # An operator has stranded packages collected.
        caller.must_be("customer", "operator")
        acceptance = acceptances.of(caller.subject_id)
        with acceptance.booking.arriving():
            call = await keyed_call(request, caller, idempotency_key)
            answer = await acceptance.accept(caller, wanted, call)
        if holder_of(request).is_session:
            # The stored answer may have been that to a key, so the link leaves it here.
            shown = {**json.loads(answer.body), "tracking_url": None}
            answer = replace(answer, body=json.dumps(shown).encode())
        return response_of(answer)

    @router.post("/v1/deliveries/{delivery_id}/cancel", responses=conflicts("TOO_LATE"))
    async def cancel_delivery(
        delivery_id: DeliveryId,
        caller: KeyCaller,
        wanted: Annotated[CancelRequest | None, Body()] = None,
    ) -> Delivery:
        """Cancel a delivery, or some of its packages.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        cancelled = await canceller.cancel(caller, delivery_id, wanted or CancelRequest())
        return shown_to(caller, cancelled)

    _add_changes(router, changers)
    return router


def _add_changes(router: ServiceRouter, changers: ByMode[Changer]) -> None:
    @router.patch(
        "/v1/deliveries/{delivery_id}",
        responses=conflicts("CHANGED_MEANWHILE", "NO_OFFER", "SHARED_TRIP", "TOO_LATE"),
    )
    async def change_delivery(
        delivery_id: DeliveryId, caller: KeyCaller, wanted: Annotated[DeliveryChange, Body()]
    ) -> ShownDelivery:
        """Change people, instructions, metadata or reference until the hand-over.

        Times, `qos`, destinations and packages are changed until a drone is sent: it is booked
        anew, in its place in the queue, and by the tariff of its accepted offer.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        return await changers.of(caller.subject_id).change(caller, delivery_id, wanted)

    @router.delete("/v1/deliveries/{delivery_id}/personal-data")
    async def erase_personal_data(delivery_id: DeliveryId, caller: KeyCaller) -> ErasedPersonalData:
        """Erase recipients, sender, instructions and metadata of a delivery, for ever.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        return await changers.of(caller.subject_id).erase(caller, delivery_id)


def report_routes(*, gate: ServiceGate, applier: ReportApplier) -> ServiceRouter:
    """POST /internal/mission-reports and /internal/mission-reports/many."""
    router = ServiceRouter(tags=("internal",))

    @router.post(MISSION_REPORTS, status_code=204, responses=conflicts("NOT_YET"))
    async def receive_mission_report(
        caller: Annotated[Caller, Depends(gate)],
        report: Annotated[MissionReport, Depends(internal_body(MissionReport))],
    ) -> Response:
        """Accept one report of a mission; 409 NOT_YET asks for it again later."""
        caller.must_be_service("composition")
        await applier.apply(report)
        return Response(status_code=204)

    @router.post(MANY_MISSION_REPORTS, status_code=204, responses=conflicts("NOT_YET"))
    async def receive_mission_reports(
        caller: Annotated[Caller, Depends(gate)],
        reports: Annotated[MissionReports, Depends(internal_body(MissionReports))],
    ) -> Response:
        """Accept reports of several missions; after a refusal the later reports are refused too."""
        caller.must_be_service("composition")
        await applier.apply_all(reports.reports)
        return Response(status_code=204)

    return router
