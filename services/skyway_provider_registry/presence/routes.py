"""Composition's mission reports: a hint at who is busy."""

from collections.abc import Sequence
from typing import Annotated

from fastapi import Depends, Response

from skyway.contracts.mission_reports import (
    MANY_MISSION_REPORTS,
    MISSION_REPORTS,
    MissionReport,
    MissionReports,
)
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.service_router import ServiceRouter
from skyway_provider_registry.context import Context
from skyway_provider_registry.presence.store import store_reports


def presence_routes(context: Context) -> ServiceRouter:
    """POST /internal/mission-reports and /internal/mission-reports/many."""
    router = ServiceRouter(tags=("internal",))

    async def store(reports: Sequence[MissionReport]) -> None:
        async with context.db.write() as tx:
            await store_reports(tx, reports, wall_at=context.clock.wall_now())

    @router.post(MISSION_REPORTS, status_code=204)
    async def receive_mission_report(
        caller: Annotated[Caller, Depends(context.gate)],
        report: Annotated[MissionReport, Depends(internal_body(MissionReport))],
    ) -> Response:
        """Note that a drone is busy or free; repeated reports are ignored."""
        caller.must_be_service("composition")
        await store([report])
        return Response(status_code=204)

    @router.post(MANY_MISSION_REPORTS, status_code=204)
    async def receive_mission_reports(
        caller: Annotated[Caller, Depends(context.gate)],
        reports: Annotated[MissionReports, Depends(internal_body(MissionReports))],
    ) -> Response:
        """Note of several drones that they are busy or free."""
        caller.must_be_service("composition")
        await store([each.report for each in reports.reports])
        return Response(status_code=204)

    return router
