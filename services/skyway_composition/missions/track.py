"""A delivery's track: what its drones flew, where they are, what is still to be flown for it."""

from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet

from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.drone_report import DroneState
from skyway.contracts.flight_step import DeliverStep, FlightStep, FlyStep, PickUpStep, ReturnStep
from skyway.contracts.track import Track, TrackedMission, TrackedStep
from skyway.geo import Position
from skyway.ids import DeliveryId, PackageId, StationId
from skyway_composition.links.store import link_to
from skyway_composition.missions import store
from skyway_composition.missions.custody import on_board
from skyway_composition.missions.record import MissionRecord
from skyway_composition.missions.step_record import StepRecord
from skyway_composition.missions.store import MissionFilter
from skyway_composition.networks.store import stations_named

#: More missions than a delivery can have: its attempts times its trips.
_MOST_MISSIONS = 1_000


async def track_of(connection: AsyncConnection, delivery_id: DeliveryId) -> Track:
    """The missions of a delivery that were not refused, in the order of their booking."""
    shown = MissionFilter(delivery_id=delivery_id)
    records = await store.page(connection, shown, before=None, limit=_MOST_MISSIONS)
    held = on_board(await store.held_packages(connection, delivery_id))
    missions = [
        await _tracked(connection, record, carried=held)
        for record in reversed(records)
        if record.mission.state != "REFUSED"
    ]
    return Track(missions=tuple(missions))


async def _tracked(
    connection: AsyncConnection, record: MissionRecord, *, carried: AbstractSet[PackageId]
) -> TrackedMission:
    link = await link_to(connection, record.drone_id)
    state = None if link is None else link.state
    if not record.is_live or (state is not None and state.mission_id != record.mission_id):
        # What the drone does besides is not this customer's.
        state = None
    own = {package.package_id for package in record.request.packages}
    steps = [
        step
        for step in await store.steps_of(connection, record.mission_id)
        if record.is_live or step.status != "PLANNED"
    ]
    steps = _of_delivery(steps, has_load=not own.isdisjoint(carried))
    positions = await _positions(connection, steps)
    # A station that left the network, where nothing has happened yet, cannot be drawn.
    placed = [step for step in steps if _station_of(step.step) in positions]
    return TrackedMission(
        mission_id=record.mission_id,
        provider_id=record.mission.provider_id,
        drone_id=record.drone_id,
        steps=tuple(_tracked_step(step, state, positions) for step in placed),
        position=None if state is None else state.position,
        position_at=None if state is None else state.at,
        soc=None if state is None else state.soc,
    )


def _of_delivery(steps: list[StepRecord], *, has_load: bool) -> list[StepRecord]:
    """The steps up to the last hand-over: the empty drone's way home is nobody's delivery.

    With something on board and no hand-over planned all of them count: it goes somewhere.
    """
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


async def _positions(
    connection: AsyncConnection, steps: Sequence[StepRecord]
) -> Mapping[StationId, Position]:
    """Where the stations of these steps are: as the drone was told, else as they are now."""
    known = dict(_ends(steps))
    missing = {_station_of(each.step) for each in steps} - known.keys()
    for station_id, station in (await stations_named(connection, missing)).items():
        known[station_id] = station.position
    return known


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
    station_id = _station_of(step)
    there = positions[station_id]
    return TrackedStep(
        kind=step.kind,
        status="UNDER_WAY" if status == "PLANNED" and is_under_way else status,
        from_position=step.from_position if isinstance(step, FlyStep) else there,
        to_position=there,
        station_id=station_id,
        start_at=(event and event.started_at) or step.planned_start_at,
        end_at=step.planned_end_at if event is None else event.ended_at,
        package_ids=_packages_of(step),
    )


def _station_of(step: FlightStep) -> StationId:
    return step.to_id if isinstance(step, FlyStep) else step.station_id


def _packages_of(step: FlightStep) -> tuple[PackageId, ...]:
    match step:
        case PickUpStep():
            return tuple(package.package_id for package in step.packages)
        case DeliverStep() | ReturnStep():
            return step.package_ids
        case _:
            return ()
