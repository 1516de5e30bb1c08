"""GET /v1/system: how the services are, for operators."""

import asyncio
from collections.abc import Mapping
from typing import Annotated, Final

from fastapi import Depends

from skyway.contracts.figures import FIGURES, Figures, ServiceHealth, SystemHealth
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.gauges import Gauges
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.figures_routes import figures_of
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.service_router import ServiceRouter
from skyway_gateway.access.routes import KeyGate

#: How long a service may take, wall seconds.
_WITHIN_S: Final = 2.0


def system_routes(
    *, gate: KeyGate, clients: Mapping[str, ServiceClient], gauges: Gauges
) -> ServiceRouter:
    """GET /v1/system."""
    router = ServiceRouter(tags=("service",))

    @router.get("/v1/system")
    async def get_system(caller: Annotated[Caller, Depends(gate)]) -> SystemHealth:
        """Show whether each service answers, what it counts and measures, and its last errors.

        The figures are those of `/metrics`, without the buckets of histograms. They count since the
        start of the process that answers.

        Callers: operator.
        """
        caller.must_be("operator")
        own = figures_of(await gauges.read())
        others = await asyncio.gather(*(_health(name, client) for name, client in clients.items()))
        return SystemHealth(services=(_answering("gateway", own), *others))

    return router


async def _health(name: str, client: ServiceClient) -> ServiceHealth:
    try:
        answer = await client.call("GET", FIGURES, answer=Figures, timeout_s=_WITHIN_S)
    except (RemoteProblem, ServiceUnavailable):
        return ServiceHealth(service=name, is_answering=False, figures=())
    return _answering(name, answer)


def _answering(name: str, said: Figures) -> ServiceHealth:
    return ServiceHealth(
        service=name, is_answering=True, figures=said.figures, last_errors=said.last_errors
    )
