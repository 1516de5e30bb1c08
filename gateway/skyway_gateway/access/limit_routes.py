"""GET /v1/limits: what the caller may use, and what is left of it."""

from typing import Annotated

from fastapi import Depends
from pydantic import Field

from skyway.json_model import JsonModel
from skyway.runtime.http.entrance import Meters
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.service_router import ServiceRouter
from skyway_gateway.access.routes import KeyGate


class UsageBudget(JsonModel):
    """A budget that refills with time; each replica of the gateway counts by itself."""

    code: Annotated[str, Field(description="Its name, as a 429 answer has it in `code`.")]
    per_s: Annotated[float, Field(description="What it refills by, a second of wall time.")]
    burst: Annotated[int, Field(description="The most that is there at any moment.")]
    left: Annotated[int, Field(description="What is there now.")]
    full_after_s: Annotated[
        float, Field(description="Seconds of wall time until all of it is there again.")
    ]


class Limits(JsonModel):
    """What the caller may use, and what is left of it."""

    budgets: Annotated[
        tuple[UsageBudget, ...], Field(description="The budgets that refill with time.")
    ]


def limit_routes(*, gate: KeyGate, meters: Meters) -> ServiceRouter:
    """GET /v1/limits."""
    router = ServiceRouter(tags=("limits",))

    @router.get("/v1/limits")
    async def show_limits(caller: Annotated[Caller, Depends(gate)]) -> Limits:
        """Show what the caller may use, and what is left of it.

        Callers: every API key.
        """
        reading = meters.tenants.read(str(caller))
        budget = UsageBudget(
            code=reading.budget.code,
            per_s=reading.budget.per_s,
            burst=reading.budget.burst,
            left=reading.left,
            full_after_s=round(reading.full_after_s, 3),
        )
        return Limits(budgets=(budget,))

    return router
