"""Closures of a past or coming time over REST, of all kinds together."""

from typing import Annotated

from fastapi import Depends, Query

from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway_composition.closures import store
from skyway_composition.closures.close import Closings
from skyway_composition.closures.handle_orders import ClosureInfo, shown
from skyway_composition.closures.past_span import PastSpanQuery


class ClosuresQuery(PastSpanQuery, PageQuery):
    """A span, and a page of the closures in force in it."""


def span_routes(*, gate: ServiceGate, closings: Closings) -> ServiceRouter:
    """GET /v1/closures."""
    router = ServiceRouter(tags=("closures",))

    @router.get("/v1/closures")
    async def list_closures(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[ClosuresQuery, Query()]
    ) -> Page[ClosureInfo]:
        """List the closures of every kind that were in force in a span of at most a day."""
        caller.must_be("customer", "provider", "operator", "service")
        span = query.span(closings.clock.now())
        async with closings.db.read() as connection:
            rows = await store.page_in_span(
                connection, span, after=query.after_id() or "", limit=query.limit + 1
            )
        return page_of(rows, query, item=shown, sort_key=lambda row: (row.closure_id,))

    return router
