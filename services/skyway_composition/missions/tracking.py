"""What missions have done and will do: a delivery's track, and one mission with its progress.

A track is what the drones of a delivery have flown, where they are, and what they will still fly.
"""

from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import Field

from skyway.contracts.drone_report import Connection, DroneEvent, DroneState
from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    ReturnStep,
    end_of,
    packages_of,
)
from skyway.contracts.message import FleetMoment, Soc
from skyway.contracts.mission import OPEN_MISSION_STATES, Mission
from skyway.contracts.track import Track, TrackedMission, TrackedStep
from skyway.geo import Position
from skyway.ids import DeliveryId, PackageId, StationId
from skyway.json_model import JsonModel
from skyway.runtime.sql.database import Database
from skyway_composition.links.link import DroneLink
from skyway_composition.links.store import link_to
from skyway_composition.missions.mission import share_views, store
from skyway_composition.missions.mission.custody_store import held_packages, on_board
from skyway_composition.missions.mission.record import Aim, MissionRecord, Trouble
from skyway_composition.missions.mission.step_store import StepRecord, flown_totals, steps_of
from skyway_composition.missions.mission.store import MissionFilter
from skyway_composition.networks.station_store import stations_named

_MOST_MISSIONS = 1_000  # more than a delivery can have: attempts times trips


@dataclass(frozen=True, slots=True)
class _Flown:
    """A mission, its steps for the delivery, and the drone's state while it flies them."""

    mission: Mission
    steps: Sequence[StepRecord]
    state: DroneState | None


@dataclass(frozen=True, slots=True)
class _Seen:
    """Where a drone was at a moment."""

    position: Position
    at: datetime
    soc: float


async def track_of(db: Database, delivery_id: DeliveryId) -> Track:
    """The track of a delivery: its missions without refused ones, in the order of booking."""
    shown = MissionFilter(delivery_id=delivery_id)
    async with db.read() as connection:
        records = await store.page(connection, shown, before=None, limit=_MOST_MISSIONS)
        carried = on_board(await held_packages(connection, delivery_id))
        flown = [
            _flown(
                record,
                await steps_of(connection, record.mission_id),
                await link_to(connection, record.drone_id),
                carried,
                seen_as=share_views.mission_for(record, delivery_id),
            )
            for record in reversed(records)
            if record.mission.state != "REFUSED"
        ]
        named = {end_of(each.step) for one in flown for each in one.steps}
        stations = await stations_named(connection, named)
    now = {each: row.position for each, row in stations.items()}
    return Track(
        missions=tuple(_tracked(each, now) for each in flown),
        station_names={each: row.name for each, row in stations.items() if row.name},
    )


def _flown(
    record: MissionRecord,
    steps: Sequence[StepRecord],
    link: DroneLink | None,
    carried: AbstractSet[PackageId],
    *,
    seen_as: Mission,
) -> _Flown:
    """The mission for its delivery: up to the delivery's own last hand-over."""
    requested = [each.package_id for each in record.request.packages]
    own_ids = share_views.own_ids(record, seen_as.delivery_id, requested)
    has_load = not carried.isdisjoint(own_ids)
    steps = share_views.own_steps(record, seen_as.delivery_id, steps)
    own = _of_delivery(record, steps, has_load=has_load)
    goes_on = has_load or any(each.status == "PLANNED" for each in own)
    return _Flown(seen_as, own, _state_on(record, link) if goes_on else None)


def _state_on(record: MissionRecord, link: DroneLink | None) -> DroneState | None:
    """The drone's state while it flies this mission; other states do not concern the customer."""
    state = None if link is None else link.state
    if not record.is_live or state is None or state.mission_id != record.mission_id:
        return None
    return state


def _tracked(flown: _Flown, now: Mapping[StationId, Position]) -> TrackedMission:
    # Positions as sent to the drone; for other stations, their present positions.
    positions = {**now, **dict(_ends(flown.steps))}
    mission, state = flown.mission, flown.state
    seen = _seen(state, flown.steps)
    return TrackedMission(
        mission_id=mission.mission_id,
        provider_id=mission.provider_id,
        drone_id=mission.drone_id,
        steps=tuple(
            _tracked_step(step, state, positions)
            for step in flown.steps
            # A station that left the network, where nothing has happened yet, cannot be drawn.
            if end_of(step.step) in positions
        ),
        position=None if seen is None else seen.position,
        position_at=None if seen is None else seen.at,
        soc=None if seen is None else seen.soc,
    )


def _seen(state: DroneState | None, steps: Sequence[StepRecord]) -> _Seen | None:
    """Where the drone is on its mission; after a forced landing, where it came down."""
    if state is not None:
        return _Seen(state.position, state.at, state.soc)
    last = steps[-1].event if steps and steps[-1].status == "FAILED" else None
    if last is None or last.station_id is not None:
        return None
    return _Seen(last.position, last.ended_at, last.soc)


def _of_delivery(
    record: MissionRecord, steps: Sequence[StepRecord], *, has_load: bool
) -> Sequence[StepRecord]:
    """The steps up to the last hand-over: the empty drone's way home is not part of a delivery.

    With packages on board and no planned hand-over all steps count.
    """
    if record.mission.state not in OPEN_MISSION_STATES:
        steps = [each for each in steps if each.status != "PLANNED"]
    last = max(
        (
            number
            for number, each in enumerate(steps, 1)
            if isinstance(each.step, DeliverStep | ReturnStep)
            and (each.status == "PLANNED" or not has_load)
        ),
        default=None,
    )
    return steps[:last]


def _ends(steps: Sequence[StepRecord]) -> Iterator[tuple[StationId, Position]]:
    for each in steps:
        if isinstance(each.step, FlyStep):
            yield each.step.from_id, each.step.from_position
            yield each.step.to_id, each.step.to_position
        elif each.event is not None:
            yield each.step.station_id, each.event.position


def _tracked_step(
    record: StepRecord, state: DroneState | None, positions: Mapping[StationId, Position]
) -> TrackedStep:
    step, event, status = record.step, record.event, record.status
    is_under_way = state is not None and state.step_id == step.step_id
    station_id = end_of(step)
    there = positions[station_id]
    return TrackedStep(
        kind=step.kind,
        status="UNDER_WAY" if status == "PLANNED" and is_under_way else status,
        from_position=step.from_position if isinstance(step, FlyStep) else there,
        to_position=there,
        station_id=station_id,
        start_at=(event and event.started_at) or step.planned_start_at,
        end_at=step.planned_end_at if event is None else event.ended_at,
        package_ids=packages_of(step),
    )


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


def progress_of(
    record: MissionRecord,
    steps: Sequence[StepRecord],
    *,
    events: Sequence[DroneEvent],
    link: DroneLink | None,
) -> MissionProgress:
    """A mission with its steps, the totals of its ended steps, and its drone's last messages."""
    return MissionProgress(
        mission=share_views.shown_mission(record),
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


def _proposed(record: MissionRecord) -> ProposedRevision | None:
    proposal = record.proposal
    if proposal is None:
        return None
    return ProposedRevision(
        revision=proposal.mission.revision, code=proposal.code, detail=proposal.detail
    )


class ListedMission(Mission):
    """A mission, its present step, and where its drone was last seen flying it."""

    step: Annotated[
        FlightStep | None,
        Field(
            description="The first step that has not ended, as it was sent to the drone; null when "
            "the mission is over."
        ),
    ]
    position: Annotated[
        Position | None,
        Field(
            description="Longitude and latitude in degrees that the drone reported last on this "
            "mission; null while it is not on this mission."
        ),
    ]
    position_at: Annotated[
        FleetMoment | None, Field(description="When it was there; null without a position.")
    ]
    soc: Annotated[
        Soc | None, Field(description="Its state of charge there, 0 to 1; null without a position.")
    ]
    guests: Annotated[
        tuple[DeliveryId, ...],
        Field(
            description="Other deliveries whose packages fly with it; their packages are listed "
            "under the ids under which they fly."
        ),
    ] = ()


def listed(
    record: MissionRecord, step: FlightStep | None, state: DroneState | None
) -> ListedMission:
    """A mission with its present step, and with the state of its drone."""
    mission = share_views.shown_mission(record)
    is_open = mission.state in OPEN_MISSION_STATES
    is_here = is_open and state is not None and state.mission_id == mission.mission_id
    seen = state if is_here else None
    return ListedMission(
        **dict(mission),
        step=step if is_open else None,
        position=None if seen is None else seen.position,
        position_at=None if seen is None else seen.at,
        soc=None if seen is None else seen.soc,
        guests=tuple(each.delivery_id for each in record.shares[1:]),
    )
