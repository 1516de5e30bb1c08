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


class StepProgress(JsonModel):
    """A step as it was sent to the drone, and the event that ended it."""

    step: Annotated[FlightStep, Field(description="The step as it was sent to the drone.")]
    revision: Annotated[int, Field(description="Revision of the mission that brought the step.")]
    status: Annotated[
        Literal["PLANNED", "ENDED", "FAILED"],
        Field(description="PLANNED until the drone reports its end, then ENDED or FAILED."),
    ]
    event: Annotated[
        DroneEvent | None, Field(description="The event that ended the step; null before that.")
    ]


class ProposedRevision(JsonModel):
    """A revision that the drone has not answered yet, and its reason."""

    revision: Annotated[int, Field(description="Number of the proposed revision.")]
    code: Annotated[str, Field(description="Why it is proposed.", examples=["LATE"])]
    detail: Annotated[str, Field(description="The reason as a sentence.")]


class MissionProgress(JsonModel):
    """A mission with its steps so far, and the drone's last state.

    While its drone stands idle without a mission, `drone_state` may be five minutes old.
    """

    mission: Annotated[Mission, Field(description="The mission.")]
    steps: Annotated[tuple[StepProgress, ...], Field(description="Its steps, in order.")]
    flown: Annotated[
        dict[str, float],
        Field(
            description=(
                "Totals of the ended steps: flight_s, recharging_s and waiting_s in seconds, "
                "energy_j in joules."
            ),
            examples=[
                {"flight_s": 870.0, "recharging_s": 0.0, "waiting_s": 12.0, "energy_j": 550_000.0}
            ],
        ),
    ]
    waits_for_revision: Annotated[
        dict[str, Any] | None,  # code, detail, station_id and soc
        Field(
            description=(
                "Why and where the drone waits for a new revision: code, detail, station_id and "
                "soc; null while it does not wait."
            )
        ),
    ]
    trouble: Annotated[
        Trouble | None, Field(description="Why another plan is needed; null if none is.")
    ]
    proposal: Annotated[
        ProposedRevision | None,
        Field(description="The revision that waits for the drone's answer; null if none does."),
    ]
    aims: Annotated[
        tuple[Aim, ...],
        Field(description="Packages that do not go to their destinations, and where they go."),
    ]
    drone_state: Annotated[
        DroneState | None, Field(description="The drone's last state; null before the first.")
    ]
    drone_connection: Annotated[
        Connection | None,
        Field(description="The drone's last connection message; null before the first."),
    ]


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
        """List missions, the newest first: all for operators, its own for a provider or a drone."""
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
        """Show a mission with its progress."""
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
    """The provider whose missions the caller may see; None for operators and drones."""
    caller.must_be("operator", "provider", "drone")
    return ProviderId(caller.subject_id) if caller.role == "provider" else None


def _own_drone(caller: Caller) -> str | None:
    """The drone whose missions the caller may see; None unless the caller is a drone."""
    return caller.subject_id if caller.role == "drone" else None
