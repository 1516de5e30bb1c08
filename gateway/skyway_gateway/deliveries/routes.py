"""Deliveries over REST: requested and followed by customers, reported on by composition."""

from typing import Annotated

from fastapi import APIRouter, Depends, Header, Query, Request, Response
from fastapi.responses import StreamingResponse
from pydantic import Field

from skyway.contracts.mission import MissionReport
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, ProviderId
from skyway.runtime.database import Database
from skyway.runtime.errors import NotFound
from skyway.runtime.http_app import internal_body
from skyway.runtime.identity import Caller, ServiceGate
from skyway.runtime.paging import Page, PageQuery, page_of
from skyway_gateway.access.routes import KeyGate
from skyway_gateway.deliveries import store
from skyway_gateway.deliveries.accept import Acceptance
from skyway_gateway.deliveries.delivery import Delivery, DeliveryPlan, ProviderDelivery
from skyway_gateway.deliveries.follow import Follower
from skyway_gateway.deliveries.states import DeliveryState
from skyway_gateway.deliveries.store import DeliveryFilter
from skyway_gateway.notifications.stream import EventStream

_SSE_HEADERS = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}


class DeliveryListQuery(PageQuery):
    """The query of the list of deliveries."""

    state: DeliveryState | None = None
    reference: Annotated[str | None, Field(max_length=200)] = None


def delivery_routes(
    *, db: Database, gate: KeyGate, acceptance: Acceptance, stream: EventStream
) -> APIRouter:
    """/v1/deliveries, and /v1/providers/{provider_id}/deliveries."""
    router = APIRouter(tags=["deliveries"])

    @router.post("/v1/deliveries", status_code=202, response_model=Delivery)
    async def request_delivery(
        request: Request,
        caller: Annotated[Caller, Depends(gate)],
        wanted: DeliveryRequest,
        idempotency_key: Annotated[str | None, Header()] = None,
    ) -> Response:
        """Request a delivery; it is booked and flown without further calls."""
        caller.must_be("customer")
        answer = await acceptance.accept(
            caller, wanted, idempotency_key=idempotency_key, body=await request.body()
        )
        headers = dict(answer.headers)
        return Response(answer.body, answer.status, headers, media_type="application/json")

    @router.get("/v1/deliveries")
    async def list_deliveries(
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[DeliveryListQuery, Query()],
    ) -> Page[Delivery]:
        """The caller's deliveries, the newest first; operators see everybody's."""
        caller.must_be("customer", "operator")
        wanted = DeliveryFilter(query.state, query.reference)
        async with db.read() as connection:
            found = await store.page_of(connection, caller, query, wanted)
        return page_of(found, query, item=lambda it: it, sort_key=lambda it: (it.delivery_id,))

    @router.get("/v1/deliveries/{delivery_id}")
    async def get_delivery(
        delivery_id: DeliveryId, caller: Annotated[Caller, Depends(gate)]
    ) -> Delivery:
        """A delivery with its packages and missions."""
        caller.must_be("customer", "operator")
        async with db.read() as connection:
            return await store.one_of(connection, caller, delivery_id)

    @router.get("/v1/deliveries/{delivery_id}/plan")
    async def get_plan(
        delivery_id: DeliveryId, caller: Annotated[Caller, Depends(gate)]
    ) -> DeliveryPlan:
        """How it is flown; no missions while it is not planned."""
        caller.must_be("customer", "operator")
        async with db.read() as connection:
            delivery = await store.one_of(connection, caller, delivery_id)
        return DeliveryPlan(
            delivery_id=delivery_id, state=delivery.state, missions=delivery.missions
        )

    @router.get(
        "/v1/deliveries/{delivery_id}/events",
        response_class=StreamingResponse,
        responses={
            200: {"content": {"text/event-stream": {"schema": {"type": "string"}}}},
            204: {"description": "The last event was received before; nothing will come"},
        },
    )
    async def follow_delivery(
        delivery_id: DeliveryId,
        caller: Annotated[Caller, Depends(gate)],
        last_event_id: Annotated[int | None, Header(ge=0, le=2**31 - 1)] = None,
    ) -> Response:
        """Server-sent events: what happened, and what happens, up to the delivery's end."""
        caller.must_be("customer", "operator")
        async with db.read() as connection:
            await store.one_of(connection, caller, delivery_id)
        after = last_event_id or 0
        if await stream.is_over(delivery_id, after=after):
            # What tells an EventSource not to connect again.
            return Response(status_code=204)
        return StreamingResponse(
            stream.frames(delivery_id, after=after),
            media_type="text/event-stream",
            headers=_SSE_HEADERS,
        )

    @router.get("/v1/providers/{provider_id}/deliveries")
    async def list_provider_deliveries(
        provider_id: ProviderId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[PageQuery, Query()],
    ) -> Page[ProviderDelivery]:
        """The deliveries that a provider's drones fly, the newest first."""
        caller.must_be("provider", "operator")
        if caller.role == "provider" and caller.subject_id != provider_id:
            raise NotFound("provider", provider_id)
        async with db.read() as connection:
            found = await store.page_of_provider(connection, provider_id, query)
        return page_of(
            found, query, item=_for_provider, sort_key=lambda delivery: (delivery.delivery_id,)
        )

    return router


def report_routes(*, gate: ServiceGate, follower: Follower) -> APIRouter:
    """POST /internal/mission-reports."""
    router = APIRouter(tags=["internal"])

    @router.post("/internal/mission-reports", status_code=204)
    async def take_report(
        caller: Annotated[Caller, Depends(gate)],
        report: Annotated[MissionReport, Depends(internal_body(MissionReport))],
    ) -> Response:
        """Take one report of a mission; 409 NOT_YET asks for it again later."""
        caller.must_be("service")
        await follower.follow(report)
        return Response(status_code=204)

    return router


def _for_provider(delivery: Delivery) -> ProviderDelivery:
    return ProviderDelivery(
        delivery_id=delivery.delivery_id,
        state=delivery.state,
        activity=delivery.activity,
        pickup=delivery.request.pickup,
        missions=delivery.missions,
        packages=delivery.packages,
        created_at=delivery.created_at,
        updated_at=delivery.updated_at,
    )
