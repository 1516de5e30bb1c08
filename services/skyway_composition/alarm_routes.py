"""Alarms over REST: operators see and acknowledge all alarms, providers see their own."""

from typing import Annotated

from fastapi import Depends, Query, Response
from pydantic import Field

from skyway.contracts.business_faults import BUSINESS_FAULTS, BusinessFaults
from skyway.contracts.drone_report import AlarmLevel
from skyway.contracts.drones import DRONE_ALARMS, DroneAlarm
from skyway.contracts.message import FleetMoment
from skyway.errors import InvalidInput
from skyway.ids import AlarmId, ProviderId
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import NotFound
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition import alarm_store
from skyway_composition.alarm_store import Alarm, AlarmFilter, AlarmState


class AlarmQuery(PageQuery):
    """Which alarms a list shows."""

    state: Annotated[
        AlarmState | None, Field(description="Only alarms in this state; all without it.")
    ] = None
    level: Annotated[
        AlarmLevel | None, Field(description="Only alarms of this level; all without it.")
    ] = None
    provider_id: Annotated[
        ProviderId | None, Field(description="Only alarms of this provider; all without it.")
    ] = None
    from_at: Annotated[
        FleetMoment | None,
        Field(alias="from", description="Only alarms from this moment on, fleet time."),
    ] = None
    to_at: Annotated[
        FleetMoment | None,
        Field(alias="to", description="Only alarms before this moment, fleet time."),
    ] = None

    def filter(self, provider_id: str | None) -> AlarmFilter:
        """The alarms that are meant, of this provider; with None, of the one that is named, if any.

        Raises
        ------
        InvalidInput
            The span ends before it begins.
        """
        if self.from_at and self.to_at and self.from_at >= self.to_at:
            detail = f"{self.from_at.isoformat()} must be before `to`, {self.to_at.isoformat()}"
            raise InvalidInput("from", detail)
        return AlarmFilter(
            provider_id=provider_id or self.provider_id,
            state=self.state,
            level=self.level,
            since_ms=None if self.from_at is None else moment_to_ms(self.from_at),
            before_ms=None if self.to_at is None else moment_to_ms(self.to_at),
        )


class Acknowledgement(JsonModel):
    """An operator's remark on an alarm."""

    note: Annotated[
        str | None,
        Field(
            max_length=1_000,
            description="A remark for other operators, at most 1,000 characters.",
            examples=["called the provider, the drone is being recovered"],
        ),
    ] = None


def drone_alarm_routes(*, db: Database, gate: ServiceGate, mint: Mint) -> ServiceRouter:
    """POST /internal/drone-alarms."""
    router = ServiceRouter(tags=("internal",))

    @router.post(DRONE_ALARMS, status_code=204)
    async def raise_drone_alarm(
        caller: Annotated[Caller, Depends(gate)],
        requested: Annotated[DroneAlarm, Depends(internal_body(DroneAlarm))],
    ) -> Response:
        """Raise an alarm about a drone, unless one with its code is open already; or end it."""
        caller.must_be_service("registry")
        async with db.write() as tx:
            if requested.is_over:
                await alarm_store.end(
                    tx,
                    alarm_store.OF_REGISTRY & {requested.code},
                    about=(requested.drone_id, None),
                    at_ms=moment_to_ms(requested.at),
                )
            elif not await alarm_store.is_open(
                tx.connection, requested.drone_id, code=requested.code
            ):
                await alarm_store.add(
                    tx,
                    level=requested.level,
                    code=requested.code,
                    detail=requested.detail,
                    at_ms=moment_to_ms(requested.at),
                    mint=mint,
                    provider_id=requested.provider_id,
                    drone_id=requested.drone_id,
                    data=requested.data,
                )
        return Response(status_code=204)

    return router


def business_alarm_routes(
    *, db: Database, gate: ServiceGate, clock: FleetClock, mint: Mint
) -> ServiceRouter:
    """POST /internal/business-faults."""
    router = ServiceRouter(tags=("internal",))

    @router.post(BUSINESS_FAULTS, status_code=204)
    async def set_business_faults(
        caller: Annotated[Caller, Depends(gate)],
        present: Annotated[BusinessFaults, Depends(internal_body(BusinessFaults))],
    ) -> Response:
        """Raise an alarm for each new fault of these, and end the alarms about all others."""
        caller.must_be_service("registry")
        at_ms = moment_to_ms(clock.now())
        async with db.write() as tx:
            await alarm_store.set_business_faults(tx, present.faults, at_ms=at_ms, mint=mint)
        return Response(status_code=204)

    return router


def alarm_routes(*, db: Database, gate: ServiceGate, clock: FleetClock) -> ServiceRouter:
    """GET /v1/alarms and POST /v1/alarms/{alarm_id}/acknowledgements."""
    router = ServiceRouter(tags=("alarms",))

    @router.get("/v1/alarms")
    async def list_alarms(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[AlarmQuery, Query()]
    ) -> Page[Alarm]:
        """List alarms, the newest first: operators see all, a provider sees its own."""
        caller.must_be("operator", "provider")
        own = None if caller.role == "operator" else caller.subject_id
        if own is not None and query.provider_id not in (None, own):
            raise NotFound("provider", str(query.provider_id))
        shown = query.filter(own)
        async with db.read() as connection:
            rows = await alarm_store.page(
                connection,
                shown,
                before=query.after_id(),
                limit=query.limit + 1,
            )
        return page_of(
            rows, query, item=lambda alarm: alarm, sort_key=lambda alarm: (alarm.alarm_id,)
        )

    @router.post("/v1/alarms/{alarm_id}/acknowledgements")
    async def acknowledge_alarm(
        alarm_id: AlarmId,
        caller: Annotated[Caller, Depends(gate)],
        acknowledgement: Acknowledgement,
    ) -> Alarm:
        """Acknowledge an alarm; of several acknowledgements the first is kept."""
        caller.must_be("operator")
        async with db.write() as tx:
            alarm = await alarm_store.acknowledge(
                tx,
                alarm_id,
                by=str(caller),
                at_ms=moment_to_ms(clock.now()),
                note=acknowledgement.note,
            )
        if alarm is None:
            raise NotFound("alarm", alarm_id)
        return alarm

    return router
