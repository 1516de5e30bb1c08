"""GET /v1/limits: what the caller may use, and what is left of it."""

from collections.abc import Sequence

from skyway.runtime.http.entrance import Meters
from skyway.runtime.http.service_router import ServiceRouter
from skyway_gateway.access.routes import KeyCaller
from skyway_gateway.access.usage import Limits, UsageBudget, UsageCounter


def limit_routes(*, meters: Meters, counters: Sequence[UsageCounter]) -> ServiceRouter:
    """GET /v1/limits."""
    router = ServiceRouter(tags=("limits",))

    @router.get("/v1/limits")
    async def show_limits(caller: KeyCaller) -> Limits:
        """Show what the caller may use, and what is left of it.

        Callers: every API key.
        """
        budgets = [UsageBudget.of(meter.read(str(caller))) for meter in meters.of(caller)]
        quotas = [quota for each in counters for quota in await each.usage(caller)]
        return Limits(budgets=tuple(budgets), quotas=tuple(quotas))

    return router
