"""Earnings over REST."""

from typing import Annotated

from fastapi import Depends, Query

from skyway.ids import ProviderId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_gateway.access.routes import KeyGate
from skyway_gateway.deliveries.reading import earnings_store
from skyway_gateway.deliveries.reading.earnings import Earnings, EarningsQuery, earnings_of


def earnings_routes(*, db: Database, gate: KeyGate) -> ServiceRouter:
    """/v1/providers/{provider_id}/earnings."""
    router = ServiceRouter(tags=("deliveries",))

    @router.get("/v1/providers/{provider_id}/earnings")
    async def get_provider_earnings(
        provider_id: ProviderId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[EarningsQuery, Query()],
    ) -> Earnings:
        """Sum what a provider's completed missions earned, in all and by day.

        Callers: provider, operator.
        """
        caller.must_be("provider", "operator")
        if caller.role == "provider" and caller.subject_id != provider_id:
            raise NotFound("provider", provider_id)
        async with db.survey() as connection:
            return earnings_of(
                provider_id, await earnings_store.days_of(connection, provider_id, query)
            )

    return router
