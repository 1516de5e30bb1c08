"""GET /v1/system: how the services are; POST /v1/small-world: fleets to begin with."""

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from skyway.contracts.figures import (
    FIGURES,
    Figures,
    NotCounted,
    RequestedSmallWorld,
    ServiceHealth,
    SmallWorldState,
    SystemHealth,
)
from skyway.runtime.errors import Conflict, RemoteProblem, ServiceUnavailable
from skyway.runtime.http.answers import conflicts
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.metrics_routes import figures_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.metrics import Gauges
from skyway.runtime.sql.server_url import Dialect
from skyway_gateway.access.routes import KeyCaller
from skyway_gateway.context import Context


@dataclass(frozen=True, slots=True)
class SmallWorld:
    """A file that `skyway up` waits for; None where the gateway was started in another way."""

    request_file: Path | None

    @property
    def state(self) -> SmallWorldState:
        """Whether there can be one, and whether somebody has asked for it."""
        if self.request_file is None:
            return "UNAVAILABLE"
        return "REQUESTED" if self.request_file.exists() else "AVAILABLE"

    def request(self) -> None:
        """Ask for it; a second request changes nothing.

        Raises
        ------
        Conflict
            NO_SMALL_WORLD: the gateway was not started by `skyway up`.
        """
        if self.request_file is None:
            raise Conflict("NO_SMALL_WORLD", "only skyway up starts a small world")
        self.request_file.touch()


#: How long a service may take, wall seconds.
_WITHIN_S: Final = 2.0
#: SQLite runs in the services, and they have no replicas with it.
_NOT_COUNTED: Final[Mapping[Dialect, tuple[NotCounted, ...]]] = {
    "sqlite": ("BROKER",),
    "postgresql": ("BROKER", "DATABASE_SERVER", "OTHER_REPLICAS"),
}


def system_routes(
    context: Context,
    *,
    clients: Callable[[], Mapping[str, ServiceClient]],
    gauges: Gauges,
    small_world: SmallWorld,
) -> ServiceRouter:
    """GET /v1/system and POST /v1/small-world."""
    router = ServiceRouter(tags=("service",))

    @router.get("/v1/system")
    async def get_system(caller: KeyCaller) -> SystemHealth:
        """Show whether each service answers, what it counts and measures, and its last errors.

        The figures are those of `/metrics`, without the buckets of histograms. They count since the
        start of the process that answers.

        Callers: operator.
        """
        caller.must_be("operator")
        own = figures_of(await gauges.read())
        asked = clients().items()
        others = await asyncio.gather(*(_health(name, client) for name, client in asked))
        return SystemHealth(
            services=(_answering("gateway", own), *others),
            not_counted=_NOT_COUNTED[context.db.dialect],
            small_world=small_world.state,
        )

    @router.post("/v1/small-world", status_code=202, responses=conflicts("NO_SMALL_WORLD"))
    async def start_small_world(caller: KeyCaller) -> RequestedSmallWorld:
        """Have `skyway up` publish the bundled network, start fleets and request deliveries.

        The fleets are simulated, and everything is registered like any other fleet.

        Callers: operator.
        """
        caller.must_be("operator")
        small_world.request()
        return RequestedSmallWorld(small_world=small_world.state)

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
