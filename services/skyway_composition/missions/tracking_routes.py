"""Tracks and missions over REST: for the gateway, operators, providers and drones."""

from typing import Annotated, Literal

from fastapi import Depends, Query
from pydantic import Field

from skyway.contracts.mission import MissionState
from skyway.contracts.track import Track
from skyway.ids import DeliveryId, MissionId, ProviderId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_composition.links.store import link_to, states_of
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.step_store import (
    ended_events,
    next_steps_of,
    steps_of,
)
from skyway_composition.missions.mission.store import MissionFilter
from skyway_composition.missions.tracking import (
    ListedMission,
    MissionProgress,
    listed,
    progress_of,
    track_of,
)

MissionLoading = Literal["AUTOMATIC", "CONFIRMED", "AWAITED"]


class MissionQuery(PageQuery):
    """Which missions a list shows."""

    state: Annotated[MissionState | None, Field(description="Only missions in this state.")] = None
    delivery_id: Annotated[
        str | None, Field(max_length=64, description="Only missions of this delivery.")
    ] = None
    drone_id: Annotated[
        str | None, Field(max_length=64, description="Only missions of this drone.")
    ] = None
    loading: Annotated[
        MissionLoading | None, Field(description="Only missions that are loaded like this.")
    ] = None


def tracking_routes(*, db: Database, gate: ServiceGate) -> ServiceRouter:
    """GET under /v1/missions, and the track under /internal/deliveries."""
    router = ServiceRouter(tags=("missions",))

    @router.get("/internal/deliveries/{delivery_id}/track")
    async def get_delivery_track(
        delivery_id: DeliveryId, caller: Annotated[Caller, Depends(gate)]
    ) -> Track:
        """What a delivery's drones flew, where they are, and what they will fly for it."""
        caller.must_be_service("gateway")
        return await track_of(db, delivery_id)

    @router.get("/v1/missions")
    async def list_missions(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[MissionQuery, Query()]
    ) -> Page[ListedMission]:
        """List missions, the newest first: all for operators, its own for a provider or a drone."""
        shown = MissionFilter(
            provider_id=_own(caller),
            state=query.state,
            delivery_id=query.delivery_id,
            drone_id=_own_drone(caller) or query.drone_id,
            loading=query.loading,
        )
        async with db.read() as connection:
            rows = await store.page(
                connection,
                shown,
                before=query.after_id(),
                limit=query.limit + 1,
            )
            steps = await next_steps_of(connection, [record.mission_id for record in rows])
            states = await states_of(connection, {record.drone_id for record in rows})
        return page_of(
            rows,
            query,
            item=lambda each: listed(each, steps.get(each.mission_id), states.get(each.drone_id)),
            sort_key=lambda each: (each.mission_id,),
        )

    @router.get("/v1/missions/{mission_id}")
    async def get_mission(
        mission_id: MissionId, caller: Annotated[Caller, Depends(gate)]
    ) -> MissionProgress:
        """Show a mission with its progress; for a guest's id, the host's mission."""
        async with db.read() as connection:
            host_id = await store.host_of(connection, mission_id) or mission_id
            record = await store.get(connection, host_id, provider_id=_own(caller))
            if record is None or _own_drone(caller) not in (None, record.drone_id):
                raise NotFound("mission", mission_id)
            steps = await steps_of(connection, host_id)
            events = await ended_events(connection, host_id, steps)
            link = await link_to(connection, record.drone_id)
        return progress_of(record, steps, events=events, link=link)

    return router


def _own(caller: Caller) -> ProviderId | None:
    """The provider whose missions the caller may see; None for operators and drones."""
    caller.must_be("operator", "provider", "drone")
    return ProviderId(caller.subject_id) if caller.role == "provider" else None


def _own_drone(caller: Caller) -> str | None:
    """The drone whose missions the caller may see; None unless the caller is a drone."""
    return caller.subject_id if caller.role == "drone" else None
