"""Quotes over REST: offers that a customer may take, within two minutes."""

from fastapi import Request, Response

from skyway.ids import QuoteId
from skyway.runtime.http.answers import IdempotencyKey, conflicts, keyed_call, response_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway_gateway.access.routes import KeyCaller
from skyway_gateway.context import Context
from skyway_gateway.livemode import ByMode
from skyway_gateway.quotes import store
from skyway_gateway.quotes.make_quote import QuoteMaker, QuoteRequest
from skyway_gateway.quotes.store import Quote


def quote_routes(context: Context, *, makers: ByMode[QuoteMaker]) -> ServiceRouter:
    """POST /v1/quotes and GET /v1/quotes/{quote_id}."""
    router = ServiceRouter(tags=("quotes",))

    @router.post(
        "/v1/quotes",
        status_code=201,
        response_model=Quote,
        responses=conflicts("NO_NETWORK", "TOO_MANY_HOLDS"),
    )
    async def create_quote(
        request: Request,
        caller: KeyCaller,
        requested: QuoteRequest,
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Ask for offers, the best first; they reserve nothing unless held; one can be accepted.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        call = await keyed_call(request, caller, idempotency_key)
        maker = makers.of(caller.subject_id)
        return response_of(await maker.make(caller, requested, call))

    @router.get("/v1/quotes/{quote_id}")
    async def get_quote(quote_id: QuoteId, caller: KeyCaller) -> Quote:
        """Show a quote, and which of its offers was accepted.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with context.db.read() as connection:
            return await store.one_of(connection, caller, quote_id)

    return router
