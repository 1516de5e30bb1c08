"""Missions over REST: the gateway books them, operators and providers see them."""

from typing import Annotated, Any, Literal

from fastapi import Depends, Query
from pydantic import Field

from skyway.contracts.drone_report import Connection, DroneEvent, DroneState
from skyway.contracts.flight_step import FlightStep
from skyway.contracts.mission import Booking, BookMissions, ClosedDelivery, Mission, MissionState
from skyway.contracts.track import Track
from skyway.ids import DeliveryId, DroneId, MissionId, ProviderId
from skyway.json_model import JsonModel
from skyway.runtime.errors import NotFound
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_composition.links.store import link_to
from skyway_composition.missions.booking.book import Bookings
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.record import Aim, MissionRecord, Trouble
from skyway_composition.missions.mission.step_record import flown_totals
from skyway_composition.missions.mission.step_store import ended_events, steps_of
from skyway_composition.missions.mission.store import MissionFilter
from skyway_composition.missions.track import track_of

MissionLoading = Literal["AUTOMATIC", "CONFIRMED", "AWAITED"]


class MissionQuery(PageQuery):
    """Which missions a list shows."""

    state: MissionState | None = None
    delivery_id: Annotated[str | None, Field(max_length=64)] = None
    drone_id: Annotated[str | None, Field(max_length=64)] = None
    loading: MissionLoading | None = None


class StepProgress(JsonModel):
    """A step as it was sent to the drone, and the event that ended it."""

    step: FlightStep
    revision: int
    status: Literal["PLANNED", "ENDED", "FAILED"]
    event: DroneEvent | None


class ProposedRevision(JsonModel):
    """A revision that the drone has still to answer, and why it is proposed."""

    revision: int
    code: str
    detail: str


class MissionProgress(JsonModel):
    """A mission with its steps so far, and what the drone last said of itself.

    While its drone stands idle without a mission, `drone_state` may be five minutes old.
    `trouble` is why another plan is looked for, `aims` are the packages that go elsewhere than to
    their destinations.
    """

    mission: Mission
    steps: tuple[StepProgress, ...]
    flown: dict[str, float]
    waits_for_revision: dict[str, Any] | None  # code, detail, station_id and soc
    trouble: Trouble | None
    proposal: ProposedRevision | None
    aims: tuple[Aim, ...]
    drone_state: DroneState | None
    drone_connection: Connection | None


def mission_routes(*, db: Database, gate: ServiceGate, bookings: Bookings) -> ServiceRouter:
    """/v1/missions, and the gateway's PUTs under /internal/deliveries."""
    router = ServiceRouter(tags=("missions",))

    @router.put("/internal/deliveries/{delivery_id}/missions")
    async def book_missions(
        delivery_id: DeliveryId,
        caller: Annotated[Caller, Depends(gate)],
        wanted: Annotated[BookMissions, Depends(internal_body(BookMissions))],
    ) -> Booking:
        """Book the best offer; the same attempt again answers the same missions."""
        caller.must_be("service")
        return await bookings.book(delivery_id, wanted)

    @router.put("/internal/deliveries/{delivery_id}/closed")
    async def close_delivery(
        delivery_id: DeliveryId, caller: Annotated[Caller, Depends(gate)]
    ) -> ClosedDelivery:
        """Book nothing more for a delivery, unless something is booked already."""
        caller.must_be("service")
        return await bookings.close(delivery_id)

    @router.get("/internal/deliveries/{delivery_id}/track")
    async def get_delivery_track(
        delivery_id: DeliveryId, caller: Annotated[Caller, Depends(gate)]
    ) -> Track:
        """What a delivery's drones flew, where they are, and what they will fly for it."""
        caller.must_be("service")
        return await track_of(db, delivery_id)

    @router.get("/v1/missions")
    async def list_missions(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[MissionQuery, Query()]
    ) -> Page[Mission]:
        """Missions, the newest first: all for operators, its own for a provider or a drone."""
        shown = MissionFilter(
            provider_id=_own(caller),
            state=query.state,
            delivery_id=query.delivery_id,
            drone_id=_own_drone(caller) or query.drone_id,
            loading=query.loading,
        )
        after = query.after(str)
        async with db.read() as connection:
            rows = await store.page(
                connection,
                shown,
                before=str(after[0]) if after else None,
                limit=query.limit + 1,
            )
        return page_of(
            rows,
            query,
            item=lambda record: record.mission,
            sort_key=lambda record: (record.mission_id,),
        )

    @router.get("/v1/missions/{mission_id}")
    async def get_mission(
        mission_id: MissionId, caller: Annotated[Caller, Depends(gate)]
    ) -> MissionProgress:
        """A mission with its progress."""
        async with db.read() as connection:
            record = await store.get(connection, mission_id, provider_id=_own(caller))
            if record is None or _own_drone(caller) not in (None, record.drone_id):
                raise NotFound("mission", mission_id)
            steps = await steps_of(connection, mission_id)
            events = await ended_events(connection, mission_id)
            link = await link_to(connection, DroneId(record.drone_id))
        return MissionProgress(
            mission=record.mission,
            steps=tuple(
                StepProgress(
                    step=each.step, revision=each.revision, status=each.status, event=each.event
                )
                for each in steps
            ),
            flown=flown_totals(events),
            waits_for_revision=None if record.stuck is None else record.stuck.model_dump(),
            trouble=record.trouble,
            proposal=_proposed(record),
            aims=record.aims,
            drone_state=None if link is None else link.state,
            drone_connection=None if link is None else link.connection,
        )

    return router


def _proposed(record: MissionRecord) -> ProposedRevision | None:
    proposal = record.proposal
    if proposal is None:
        return None
    return ProposedRevision(
        revision=proposal.mission.revision, code=proposal.code, detail=proposal.detail
    )


def _own(caller: Caller) -> ProviderId | None:
    """The provider whose missions the caller may see; None when that is not what decides."""
    caller.must_be("operator", "provider", "drone")
    return ProviderId(caller.subject_id) if caller.role == "provider" else None


def _own_drone(caller: Caller) -> str | None:
    """The drone that sees its own missions only; None for everybody else."""
    return caller.subject_id if caller.role == "drone" else None
