"""GET /internal/figures: counters, gauges and errors of a service, for the gateway."""

from collections.abc import Iterable
from typing import Annotated, Final

from fastapi import Depends

from skyway.contracts.figures import FIGURES, Figure, Figures
from skyway.runtime.durations import DURATIONS
from skyway.runtime.gauges import Gauge, Gauges, gauge_families
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.last_errors import LAST_ERRORS
from skyway.runtime.metrics import COUNTERS

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
