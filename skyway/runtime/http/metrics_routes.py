"""The counters, gauges and last errors of a process: GET /metrics and GET /internal/figures.

/metrics is for Prometheus and others with the deployment's metrics key. The key is a secret file,
so it can be checked while the database is away. /internal/figures is for the gateway.
"""

import hmac
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from fastapi import Depends, Request, Response
from fastapi.openapi.models import HTTPBearer as HTTPBearerModel
from fastapi.responses import PlainTextResponse
from fastapi.security.base import SecurityBase
from fastapi.security.utils import get_authorization_scheme_param

from skyway.contracts.figures import FIGURES, Figure, Figures
from skyway.runtime.errors import InvalidSettings, Unauthenticated
from skyway.runtime.http.app import Readiness
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.metrics import (
    COUNTERS,
    DURATIONS,
    METRICS_KEY,
    Gauge,
    Gauges,
    GaugeSource,
    gauge_families,
)
from skyway.runtime.peer_secrets import read_secret
from skyway.runtime.tracing import LAST_ERRORS

if TYPE_CHECKING:
    from prometheus_client import Metric


class MetricsGate(SecurityBase):
    """A dependency that accepts only callers with the metrics key.

    The file is read at each call, so another key in it counts immediately.
    """

    model = HTTPBearerModel(description="the deployment's metrics key")
    scheme_name = "MetricsKey"

    def __init__(self, secrets_dir: Path) -> None:
        self._secrets_dir = secrets_dir

    async def __call__(self, request: Request) -> None:
        """Go on for a caller that shows the key.

        Raises
        ------
        Unauthenticated
            No key or a wrong key is shown, or the deployment has no such key.
        """
        scheme, shown = get_authorization_scheme_param(request.headers.get("Authorization"))
        if scheme.lower() != "bearer" or not shown:
            raise Unauthenticated("the metrics key is needed: Authorization: Bearer ...")
        try:
            key = read_secret(self._secrets_dir, METRICS_KEY)
        except InvalidSettings as error:
            raise Unauthenticated("this deployment has no metrics key: skyway secrets") from error
        if not hmac.compare_digest(shown.encode(), key.encode()):
            raise Unauthenticated("this is not the metrics key")


def metrics_routes(*, gate: MetricsGate, gauges: Gauges) -> ServiceRouter:
    """GET /metrics."""
    router = ServiceRouter(tags=("service",))

    @router.get("/metrics", response_class=PlainTextResponse, dependencies=[Depends(gate)])
    async def get_metrics() -> Response:
        """The counters and gauges of the process, for Prometheus; the metrics key is needed."""
        content, content_type = exposition(await gauges.read())
        return Response(content, headers={"Content-Type": content_type})

    return router


def exposition(readings: Iterable[Gauge] = ()) -> tuple[bytes, str]:
    """The counters and histograms of this process and these gauges; and their content type."""
    from prometheus_client import CollectorRegistry, ProcessCollector, generate_latest
    from prometheus_client.exposition import CONTENT_TYPE_PLAIN_1_0_0
    from prometheus_client.registry import Collector

    class _Measured(Collector):
        def collect(self) -> "Iterable[Metric]":
            yield from COUNTERS.collect()
            yield from DURATIONS.collect()
            yield from gauge_families(readings)

    registry = CollectorRegistry()
    registry.register(_Measured())
    ProcessCollector(registry=registry)
    return generate_latest(registry), CONTENT_TYPE_PLAIN_1_0_0


def readiness_gauges(readiness: Readiness) -> GaugeSource:
    """`skyway_part_ready`: 1 for each part that GET /readyz finds, and 0 for a missing part."""

    async def read() -> list[Gauge]:
        about = "whether a part that the service needs is there"
        return [
            Gauge("skyway_part_ready", about, float(is_there), {"part": part})
            for part, is_there in (await readiness()).items()
        ]

    return GaugeSource("parts", read)


#: Samples that a page does not show: parts of histograms, and moments of creation.
_LEFT_OUT: Final = ("_bucket", "_created")


def figures_of(readings: Iterable[Gauge]) -> Figures:
    """The counters, the given gauges and the last errors of this process."""
    from prometheus_client import CollectorRegistry, ProcessCollector

    registry = CollectorRegistry()
    ProcessCollector(registry=registry)
    families = [
        *COUNTERS.collect(),
        *DURATIONS.collect(),
        *gauge_families(readings),
        *registry.collect(),
    ]
    return Figures(
        figures=tuple(
            Figure(name=sample.name, labels=dict(sample.labels), value=sample.value)
            for family in families
            for sample in family.samples
            if not sample.name.endswith(_LEFT_OUT)
        ),
        last_errors=tuple(LAST_ERRORS.newest()),
    )


def figures_routes(*, gate: ServiceGate, gauges: Gauges) -> ServiceRouter:
    """GET /internal/figures."""
    router = ServiceRouter(tags=("internal",))

    @router.get(FIGURES)
    async def get_figures(caller: Annotated[Caller, Depends(gate)]) -> Figures:
        """The counters, gauges and last errors of this process."""
        caller.must_be_service("gateway")
        return figures_of(await gauges.read())

    return router
