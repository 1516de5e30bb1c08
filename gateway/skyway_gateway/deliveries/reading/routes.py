"""Deliveries, earnings and statistics as customers, operators and providers read them."""

from contextlib import nullcontext
from typing import Annotated

from fastapi import Header, Query, Request, Response
from fastapi.responses import StreamingResponse

from skyway.contracts.track import Track
from skyway.ids import DeliveryId, ProviderId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.answers import GeoJsonResponse
from skyway.runtime.http.event_stream import EventStreamAnswer
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.limits import FairQueue, Slots
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_gateway.access.routes import KeyCaller
from skyway_gateway.clients import DeliveryComposition
from skyway_gateway.context import Context
from skyway_gateway.deliveries.lifecycle.customer_forms import ShownDelivery, shown_to
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.reading import read_store
from skyway_gateway.deliveries.reading.read_store import Counted, DeliveryListQuery
from skyway_gateway.deliveries.reading.statistics import (
    DeliveryQuery,
    DeliveryStatistics,
    PromiseStatistics,
    groups_of,
    promises_of,
    statistics,
)
from skyway_gateway.deliveries.reading.views import (
    DeliveryPlan,
    DeliveryProof,
    Earnings,
    EarningsQuery,
    Exchange,
    FeatureCollection,
    ProviderDelivery,
    earnings_of,
    feature_collection,
    for_provider,
    proof_of,
)
from skyway_gateway.deliveries.records import delivery_store, exchange_store
from skyway_gateway.lateness.lateness_forecast import LatenessForecast, host_delay_ms
from skyway_gateway.lateness.store import kept_promises
from skyway_gateway.notifications.delivery_events import EventStream
from skyway_gateway.personal_data import store as personal_data
from skyway_gateway.proofs import store as proof_store


def reading_routes(
    context: Context, *, composition: DeliveryComposition, stream: EventStream, slots: Slots
) -> ServiceRouter:
    """GET /v1/deliveries and all below it; a provider's /deliveries and /exchanges."""
    router = ServiceRouter(tags=("deliveries",))
    _add_lists(router, context.db)
    _add_details(router, context.db, composition)
    _add_events(router, context.db, stream, slots)
    return router


def _add_lists(router: ServiceRouter, db: Database) -> None:
    @router.get("/v1/deliveries")
    async def list_deliveries(
        caller: KeyCaller,
        query: Annotated[DeliveryListQuery, Query()],
    ) -> Page[Delivery]:
        """List the caller's deliveries, the newest first; operators see all deliveries.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with db.read() as connection:
            page = await read_store.page_of(connection, caller, query)
            found = await read_store.with_places(connection, page)
        return page_of(
            found,
            query,
            item=lambda delivery: shown_to(caller, delivery),
            sort_key=lambda delivery: (delivery.delivery_id,),
        )

    @router.get("/v1/providers/{provider_id}/deliveries")
    async def list_provider_deliveries(
        provider_id: ProviderId,
        caller: KeyCaller,
        query: Annotated[PageQuery, Query()],
    ) -> Page[ProviderDelivery]:
        """List the deliveries that a provider's drones fly, the newest first.

        Callers: provider, operator.
        """
        caller.must_be("provider", "operator")
        if caller.role == "provider" and caller.subject_id != provider_id:
            raise NotFound("provider", provider_id)
        async with db.read() as connection:
            found = await read_store.page_of_provider(connection, provider_id, query)
            flown = [each.delivery_id for each in found if each.live_missions]
            personal = await personal_data.every_of(connection, flown)
        return page_of(
            found,
            query,
            item=lambda delivery: for_provider(delivery, personal.get(delivery.delivery_id)),
            sort_key=lambda delivery: (delivery.delivery_id,),
        )

    @router.get("/v1/providers/{provider_id}/exchanges")
    async def list_provider_exchanges(
        provider_id: ProviderId,
        caller: KeyCaller,
        query: Annotated[PageQuery, Query()],
    ) -> Page[Exchange]:
        """List the missions that came to a provider or left it by exchange, the newest first.

        Callers: provider, operator.
        """
        caller.must_be("provider", "operator")
        if caller.role == "provider" and caller.subject_id != provider_id:
            raise NotFound("provider", provider_id)
        async with db.read() as connection:
            found = await exchange_store.page_of(connection, provider_id, query)
        return page_of(
            found, query, item=Exchange.of_row, sort_key=lambda row: (str(row.event_id),)
        )


def _add_details(router: ServiceRouter, db: Database, composition: DeliveryComposition) -> None:
    @router.get("/v1/deliveries/{delivery_id}")
    async def get_delivery(delivery_id: DeliveryId, caller: KeyCaller) -> ShownDelivery:
        """Show a delivery with its packages, missions and people.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with db.read() as connection:
            delivery = await delivery_store.one_of(connection, caller, delivery_id)
            [found] = await read_store.with_places(connection, [delivery])
            personal = await personal_data.one_of(connection, delivery_id)
            proofs = await proof_store.of_delivery(connection, delivery_id)
        return ShownDelivery.of(shown_to(caller, found), personal, proofs)

    @router.get("/v1/deliveries/{delivery_id}/plan")
    async def get_delivery_plan(delivery_id: DeliveryId, caller: KeyCaller) -> DeliveryPlan:
        """Show how a delivery is flown; it has no missions before it is planned.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with db.read() as connection:
            delivery = await delivery_store.one_of(connection, caller, delivery_id)
        missions = shown_to(caller, delivery).missions
        return DeliveryPlan(delivery_id=delivery_id, state=delivery.state, missions=missions)

    @router.get("/v1/deliveries/{delivery_id}/proof")
    async def get_delivery_proof(delivery_id: DeliveryId, caller: KeyCaller) -> DeliveryProof:
        """Show what proves the hand-over of each package: place, time and masses.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with db.read() as connection:
            delivery = await delivery_store.one_of(connection, caller, delivery_id)
        return proof_of(delivery)

    @router.get("/v1/deliveries/{delivery_id}/track", response_class=GeoJsonResponse)
    async def get_delivery_track(delivery_id: DeliveryId, caller: KeyCaller) -> FeatureCollection:
        """Show as GeoJSON what was flown, what will be flown, and where the drones are.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with db.read() as connection:
            delivery = await delivery_store.one_of(connection, caller, delivery_id)
        # Composition does not know a delivery for which nothing was booked yet.
        track = await composition.track(delivery_id) if delivery.missions else Track(missions=())
        return feature_collection(delivery, track)


def _add_events(router: ServiceRouter, db: Database, stream: EventStream, slots: Slots) -> None:
    @router.get(
        "/v1/deliveries/{delivery_id}/events",
        response_class=StreamingResponse,
        responses={
            200: {"content": {"text/event-stream": {"schema": {"type": "string"}}}},
            204: {"description": "The last event was received before; nothing will come"},
        },
    )
    async def stream_delivery_events(
        request: Request,
        delivery_id: DeliveryId,
        caller: KeyCaller,
        last_event_id: Annotated[int | None, Header(ge=0, le=2**31 - 1)] = None,
    ) -> Response:
        """Follow a delivery by server-sent events, from its first event to its last.

        The stream ends within a second when the key is deleted.

        The `data` of each event is one of the forms of the `delivery-event` webhook.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with db.read() as connection:
            await delivery_store.require_own(connection, caller, delivery_id)
        after = last_event_id or 0
        if after and await stream.is_over(delivery_id, after=after):
            # 204 stops an EventSource from connecting again.
            return Response(status_code=204)
        frames = stream.frames(delivery_id, after=after, may_read=request.state.is_still_known)
        return EventStreamAnswer(nullcontext(frames), slots=slots, who=str(caller))


def earnings_routes(context: Context, *, reporting: FairQueue) -> ServiceRouter:
    """/v1/providers/{provider_id}/earnings."""
    router = ServiceRouter(tags=("deliveries",))

    @router.get("/v1/providers/{provider_id}/earnings")
    async def get_provider_earnings(
        provider_id: ProviderId,
        caller: KeyCaller,
        query: Annotated[EarningsQuery, Query()],
    ) -> Earnings:
        """Sum what a provider's completed missions earned, in all and by day.

        Callers: provider, operator.
        """
        caller.must_be("provider", "operator")
        if caller.role == "provider" and caller.subject_id != provider_id:
            raise NotFound("provider", provider_id)
        async with reporting.turn(str(caller)), context.db.survey() as connection:
            return earnings_of(
                provider_id, await read_store.days_of(connection, provider_id, query)
            )

    return router


def statistics_routes(
    context: Context, *, reporting: FairQueue, forecast: LatenessForecast
) -> ServiceRouter:
    """GET /v1/stats/deliveries and /v1/stats/promises."""
    router = ServiceRouter(tags=("statistics",))

    @router.get("/v1/stats/deliveries")
    async def get_delivery_statistics(
        caller: KeyCaller, query: Annotated[DeliveryQuery, Query()]
    ) -> DeliveryStatistics:
        """Sum up the deliveries of a span, and the requests that wait; a provider sees its own.

        Callers: provider, operator.
        """
        caller.must_be("provider", "operator")
        now = context.clock.now()
        span, provider_id = query.span(now), _provider(caller, query.provider_id)
        counted = Counted(
            span,
            provider_id,
            query.bucket_ms(span),
            host_delay_ms=host_delay_ms(context.clock),
        )
        async with reporting.turn(str(caller)), context.db.survey() as connection:
            found = await read_store.sums(connection, counted)
            waiting = None
            if provider_id is None:
                waiting = await read_store.waiting(connection, now_ms=moment_to_ms(now))
        return statistics(found, query, span=span, provider_id=provider_id, waiting=waiting)

    @router.get("/v1/stats/promises")
    async def get_promise_statistics(
        caller: KeyCaller,
    ) -> PromiseStatistics:
        """Show which share of the packages came by their P90, in the last day and week.

        Callers: provider, operator.
        """
        caller.must_be("provider", "operator")
        now = context.clock.now()
        async with reporting.turn(str(caller)), context.db.survey() as connection:
            rows = await kept_promises(
                connection, now_ms=moment_to_ms(now), host_delay_ms=host_delay_ms(context.clock)
            )
        provider_id = _provider(caller, None)
        return PromiseStatistics(
            at=now,
            items=promises_of(rows, provider_id=provider_id),
            groups=groups_of(forecast.coverage(provider_id)),
        )

    return router


def _provider(caller: Caller, asked: ProviderId | None) -> ProviderId | None:
    """Whose statistics are shown: a provider's own, or whosever an operator asks for."""
    if caller.role == "operator":
        return asked
    if asked not in (None, caller.subject_id):
        raise NotFound("provider", str(asked))
    return ProviderId(caller.subject_id)
