"""Composition's mission reports: a hint at who is busy."""

from typing import Annotated

from fastapi import APIRouter, Depends, Response

from skyway.contracts.mission import MissionReport
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database
from skyway.runtime.http_app import internal_body
from skyway.runtime.identity import Caller, ServiceGate
from skyway_provider_registry.presence import store


def presence_routes(*, db: Database, gate: ServiceGate, clock: FleetClock) -> APIRouter:
    """POST /internal/mission-reports."""
    router = APIRouter(tags=["internal"])

    @router.post("/internal/mission-reports", status_code=204)
    async def take_mission_report(
        caller: Annotated[Caller, Depends(gate)],
        report: Annotated[MissionReport, Depends(internal_body(MissionReport))],
    ) -> Response:
        """Note that a drone is busy or free; a report that is known, or of no drone, is nothing."""
        caller.must_be("service")
        async with db.write() as tx:
            await store.record_report(tx, report, wall_at=clock.wall_now())
        return Response(status_code=204)

    return router
