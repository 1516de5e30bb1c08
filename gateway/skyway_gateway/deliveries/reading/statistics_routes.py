"""Statistics of deliveries over REST; those of pads and drones are composition's."""

from typing import Annotated

from fastapi import Depends, Query

from skyway.ids import ProviderId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_gateway.access.routes import KeyGate
from skyway_gateway.deliveries.reading import statistics_store
from skyway_gateway.deliveries.reading.statistics import (
    DeliveryQuery,
    DeliveryStatistics,
    statistics,
)
from skyway_gateway.deliveries.reading.statistics_store import Counted


def statistics_routes(*, db: Database, gate: KeyGate, clock: FleetClock) -> ServiceRouter:
    """GET /v1/stats/deliveries."""
    router = ServiceRouter(tags=("statistics",))

    @router.get("/v1/stats/deliveries")
    async def get_delivery_statistics(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[DeliveryQuery, Query()]
    ) -> DeliveryStatistics:
        """Sum up the deliveries of a span, and the requests that wait; a provider sees its own.

        Callers: provider, operator.
        """
        caller.must_be("provider", "operator")
        now = clock.now()
        span, provider_id = query.span(now), _provider(caller, query.provider_id)
        counted = Counted(span, provider_id, query.bucket_ms(span))
        async with db.survey() as connection:
            found = await statistics_store.sums(connection, counted)
            waiting = None
            if provider_id is None:
                waiting = await statistics_store.waiting(connection, now_ms=moment_to_ms(now))
        return statistics(found, query, span=span, provider_id=provider_id, waiting=waiting)

    return router


def _provider(caller: Caller, asked: ProviderId | None) -> ProviderId | None:
    """Whose statistics are shown: a provider's own, or whosever an operator asks for."""
    if caller.role == "operator":
        return asked
    if asked not in (None, caller.subject_id):
        raise NotFound("provider", str(asked))
    return ProviderId(caller.subject_id)
