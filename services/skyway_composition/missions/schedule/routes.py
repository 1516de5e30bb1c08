"""Schedules and sent plans over REST: for operators of all drones, for a provider of its own."""

from typing import Annotated, Final

from fastapi import Depends, Query
from pydantic import Field

from skyway.contracts.flight_step import FlightStep
from skyway.contracts.message import FleetMoment
from skyway.ids import DroneId, MissionId, ProviderId, StationId
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.closures.routes import PastSpanQuery
from skyway_composition.links.instruction_store import SentPlan, plans_sent
from skyway_composition.links.store import link_to
from skyway_composition.missions.schedule import store
from skyway_composition.missions.schedule.schedule import (
    DroneSchedule,
    FutureSpanQuery,
    ProviderSchedule,
    ScheduleQuery,
    StationSchedule,
    schedule_of,
    station_schedule,
)
from skyway_composition.pads.store import pads_of, reservations_of

#: More than a station's pads can hold in the time that missions are booked ahead.
_MOST_RESERVATIONS: Final = 10_000


def schedule_routes(*, db: Database, gate: ServiceGate, clock: FleetClock) -> ServiceRouter:
    """GET .../schedule of a drone, of a provider and of a station."""
    router = ServiceRouter(tags=("missions",))

    @router.get("/v1/stations/{station_id}/schedule")
    async def get_station_schedule(
        station_id: StationId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[FutureSpanQuery, Query()],
    ) -> StationSchedule:
        """Show the reservations of a station's pads in a span that are not over."""
        caller.must_be("customer", "provider", "operator", "service")
        now = clock.now()
        span = query.span(now)
        async with db.read() as connection:
            pads = await pads_of(connection, station_id)
            if pads is None:
                raise NotFound("station", station_id)
            reservations = await reservations_of(
                connection,
                station_id,
                ending_after_ms=moment_to_ms(now),
                after=None,
                limit=_MOST_RESERVATIONS,
            )
        shows_missions = caller.role == "operator"
        return station_schedule(
            station_id, pads, reservations, span=span, shows_missions=shows_missions
        )

    @router.get("/v1/drones/{drone_id}/schedule")
    async def get_drone_schedule(
        drone_id: DroneId, caller: Annotated[Caller, Depends(gate)]
    ) -> DroneSchedule:
        """Show the missions of a drone that are not over, in time order.

        A drone that has never connected is not found.
        """
        caller.must_be("operator", "provider")
        async with db.read() as connection:
            link = await link_to(connection, drone_id)
            if link is None or not _may_see(caller, link.provider_id):
                raise NotFound("drone", drone_id)
            records = await store.open_of_drone(connection, drone_id)
            flown = await store.flown_times(connection, [each.mission_id for each in records])
        return schedule_of(drone_id, link.provider_id, records, flown=flown, now=clock.now())

    @router.get("/v1/drones/{drone_id}/plans")
    async def get_drone_plans(
        drone_id: DroneId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[PastSpanQuery, Query()],
    ) -> DronePlans:
        """Show the plans that a drone was sent for its missions in a span of at most a day.

        Missions that were refused or cancelled are not shown.
        """
        caller.must_be("operator", "provider")
        now = clock.now()
        span = query.span(now)
        async with db.survey() as connection:
            link = await link_to(connection, drone_id)
            if link is None or not _may_see(caller, link.provider_id):
                raise NotFound("drone", drone_id)
            mission_ids = await store.missions_of_drone(
                connection, drone_id, span, now_ms=moment_to_ms(now)
            )
            sent = await plans_sent(connection, mission_ids)
        return DronePlans(
            drone_id=drone_id,
            from_at=span.from_at,
            to_at=span.to_at,
            plans=tuple(map(drone_plan, sent)),
        )

    @router.get("/v1/providers/{provider_id}/schedule")
    async def get_provider_schedule(
        provider_id: ProviderId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[ScheduleQuery, Query()],
    ) -> ProviderSchedule:
        """Show the missions of a provider's drones in a span, drone by drone.

        Missions that were refused or cancelled are not shown.
        """
        caller.must_be("operator", "provider")
        if not _may_see(caller, provider_id):
            raise NotFound("provider", provider_id)
        now = clock.now()
        now_ms, span = moment_to_ms(now), query.span(now)
        async with db.survey() as connection:
            drone_ids = await store.drones_in_span(
                connection,
                provider_id,
                span,
                now_ms=now_ms,
                after=query.after_id(),
                limit=query.limit + 1,
            )
            by_drone = await store.missions_in_span(
                connection, provider_id, drone_ids, span, now_ms=now_ms
            )
            mission_ids = [one.mission_id for own in by_drone.values() for one in own]
            flown = await store.flown_times(connection, mission_ids)
        page = page_of(
            drone_ids,
            query,
            item=lambda each: schedule_of(each, provider_id, by_drone[each], flown=flown, now=now),
            sort_key=lambda each: (each,),
        )
        return ProviderSchedule(
            **dict(page), provider_id=provider_id, from_at=span.from_at, to_at=span.to_at
        )

    return router


def _may_see(caller: Caller, provider_id: ProviderId) -> bool:
    return caller.role == "operator" or caller.subject_id == provider_id


class DronePlan(JsonModel):
    """A plan as it was sent to a drone.

    Its steps replace the steps from `first_step` on of the mission's plan before it.
    """

    mission_id: Annotated[MissionId, Field(description="Mission of the plan.")]
    mission_revision: Annotated[
        int, Field(description="Number of the plan within its mission, from 1.")
    ]
    sent_at: Annotated[FleetMoment, Field(description="When it was sent, fleet time.")]
    is_accepted: Annotated[bool, Field(description="Whether the drone has accepted it.")]
    first_step: Annotated[int, Field(description="The first step that it replaces.")]
    steps: Annotated[
        tuple[FlightStep, ...], Field(description="Its steps, in order, with planned times.")
    ]


class DronePlans(JsonModel):
    """The plans of the missions that a drone had in a span."""

    drone_id: Annotated[DroneId, Field(description="Id of the drone.")]
    from_at: Annotated[FleetMoment, Field(description="Start of the span, fleet time.")]
    to_at: Annotated[FleetMoment, Field(description="End of the span, fleet time.")]
    plans: Annotated[
        tuple[DronePlan, ...],
        Field(description="In the order in which they were sent; some were sent before the span."),
    ]


def drone_plan(sent: SentPlan) -> DronePlan:
    """A sent plan as a replay shows it."""
    instruction = sent.instruction
    return DronePlan(
        mission_id=instruction.mission_id,
        mission_revision=instruction.mission_revision,
        sent_at=instruction.sent_at,
        is_accepted=sent.is_accepted,
        first_step=instruction.first_step,
        steps=instruction.steps,
    )
