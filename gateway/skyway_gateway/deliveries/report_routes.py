"""Mission reports over REST, as composition sends them."""

from typing import Annotated

from fastapi import Depends, Response

from skyway.contracts.mission_reports import (
    MANY_MISSION_REPORTS,
    MISSION_REPORTS,
    MissionReport,
    MissionReports,
)
from skyway.runtime.http.answers import conflicts
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway_gateway.deliveries.apply_reports import ReportApplier


def report_routes(*, gate: ServiceGate, applier: ReportApplier) -> ServiceRouter:
    """POST /internal/mission-reports and /internal/mission-reports/many."""
    router = ServiceRouter(tags=("internal",))

    @router.post(MISSION_REPORTS, status_code=204, responses=conflicts("NOT_YET"))
    async def receive_mission_report(
        caller: Annotated[Caller, Depends(gate)],
        report: Annotated[MissionReport, Depends(internal_body(MissionReport))],
    ) -> Response:
        """Take one report of a mission; 409 NOT_YET asks for it again later."""
        caller.must_be_service("composition")
        await applier.apply(report)
        return Response(status_code=204)

    @router.post(MANY_MISSION_REPORTS, status_code=204, responses=conflicts("NOT_YET"))
    async def receive_mission_reports(
        caller: Annotated[Caller, Depends(gate)],
        reports: Annotated[MissionReports, Depends(internal_body(MissionReports))],
    ) -> Response:
        """Take reports of several missions; the first that is refused refuses those after it."""
        caller.must_be_service("composition")
        await applier.apply_all(reports.reports)
        return Response(status_code=204)

    return router
