"""Composition's mission reports: a hint at who is busy."""

from typing import Annotated

from fastapi import APIRouter, Depends, Response

from skyway.contracts.mission import MissionReport
from skyway.runtime.http_app import internal_body
from skyway.runtime.identity import Caller, ServiceGate
from skyway_provider_registry.presence.reports import ReportKeeper


def presence_routes(*, keeper: ReportKeeper, gate: ServiceGate) -> APIRouter:
    """POST /internal/mission-reports."""
    router = APIRouter(tags=["internal"])

    @router.post("/internal/mission-reports", status_code=204)
    async def take_mission_report(
        caller: Annotated[Caller, Depends(gate)],
        report: Annotated[MissionReport, Depends(internal_body(MissionReport))],
    ) -> Response:
        """Note that a drone is busy or free; a report that is known, or of no drone, is nothing."""
        caller.must_be("service")
        await keeper.keep(report)
        return Response(status_code=204)

    return router
