"""Providers over REST: operators register them, and each keeps its own name, tariff and terms."""

from typing import Annotated

from fastapi import Depends, Query, Request, Response

from skyway.delivery.offer import Tariff
from skyway.errors import InvalidInput
from skyway.ids import ProviderId
from skyway.runtime.errors import AccessDenied
from skyway.runtime.http.answers import IdempotencyKey, keyed_call, response_of
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.idempotency_store import Answer, once
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_provider_registry.context import Context
from skyway_provider_registry.homes import StationLookup, currency_fault
from skyway_provider_registry.providers import store
from skyway_provider_registry.providers.provider import (
    NewProvider,
    Provider,
    ProviderCard,
    ProviderChange,
)


def provider_routes(context: Context, *, stations: StationLookup) -> ServiceRouter:
    """POST and GET /v1/providers, GET and PATCH /v1/providers/{provider_id}."""
    router = ServiceRouter(tags=("providers",))

    async def _refuse_other_currency(tariff: Tariff, provider_id: ProviderId) -> None:
        async with context.db.read() as connection:
            homes = await store.homes(connection, provider_id)
        if not homes:
            return
        check = await stations.check(homes)
        for home in check.network_ids:
            if (fault := currency_fault(tariff, check, home)) is not None:
                raise InvalidInput("tariff.currency", fault)

    @router.post("/v1/providers", status_code=201, response_model=Provider)
    async def create_provider(
        request: Request,
        caller: Annotated[Caller, Depends(context.gate)],
        requested: NewProvider,
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Register a provider."""
        caller.must_be("operator")
        provider = Provider(
            provider_id=ProviderId(context.mint("prv")),
            name=requested.name,
            tariff=requested.tariff,
            terms=requested.terms,
            state="ACTIVE",
            loading=requested.loading,
            standby=requested.standby,
            exchanges_deliveries=requested.exchanges_deliveries,
            # What is answered now is what is read later: the table keeps milliseconds.
            created_at=ms_to_moment(moment_to_ms(context.clock.now())),
        )

        async def keep(tx: Tx) -> Answer:
            await store.add(tx, provider)
            location = {"Location": f"/v1/providers/{provider.provider_id}"}
            return Answer(201, provider.model_dump_json().encode(), location)

        call = await keyed_call(request, caller, idempotency_key)
        return response_of(await once(context.db, call, act=keep, clock=context.clock))

    @router.get("/v1/providers")
    async def list_providers(
        caller: Annotated[Caller, Depends(context.gate)], query: Annotated[PageQuery, Query()]
    ) -> Page[Provider] | Page[ProviderCard]:
        """List providers: all for operators, its own for a provider, cards for customers."""
        caller.must_be("operator", "provider", "customer")
        async with context.db.read() as connection:
            if caller.role == "customer":
                every = await store.page_of_all(connection, query)
                cards = page_of(every, query, item=_card, sort_key=_sort_key)
                return Page[ProviderCard](items=cards.items, next_cursor=cards.next_cursor)
            own = await store.page_of_caller(connection, caller, query)
        whole = page_of(own, query, item=_itself, sort_key=_sort_key)
        # Of its own kind each: FastAPI would take a plain Page for the page of cards.
        return Page[Provider](items=whole.items, next_cursor=whole.next_cursor)

    @router.get("/v1/providers/{provider_id}")
    async def get_provider(
        provider_id: ProviderId, caller: Annotated[Caller, Depends(context.gate)]
    ) -> Provider | ProviderCard:
        """Show a provider; customers see its name and tariff."""
        caller.must_be("operator", "provider", "customer")
        async with context.db.read() as connection:
            if caller.role == "customer":
                return (await store.by_id(connection, provider_id)).card
            return await store.of_caller(connection, caller, provider_id=provider_id)

    @router.patch("/v1/providers/{provider_id}")
    async def update_provider(
        provider_id: ProviderId,
        caller: Annotated[Caller, Depends(context.gate)],
        requested: ProviderChange,
    ) -> Provider:
        """Change a provider's own data; only operators change `state`."""
        caller.must_be("operator", "provider")
        if requested.state is not None and caller.role != "operator":
            raise AccessDenied("only an operator changes a provider's state")
        if requested.tariff is not None:
            await _refuse_other_currency(requested.tariff, provider_id)
        async with context.db.write() as tx:
            await store.change(tx, caller, provider_id=provider_id, changes=requested)
            return await store.of_caller(tx.connection, caller, provider_id=provider_id)

    return router


def _itself(provider: Provider) -> Provider:
    return provider


def _card(provider: Provider) -> ProviderCard:
    return provider.card


def _sort_key(provider: Provider) -> tuple[str]:
    return (provider.provider_id,)
