"""The gateway reads missions, pads, closures and alarms for its live picture."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Final

from fastapi import Depends, Response

from skyway.contracts.flight_step import (
    DeliverStep,
    FlyStep,
    PickUpStep,
    ReturnStep,
    end_of,
    packages_of,
)
from skyway.contracts.live import (
    LIVE_MISSIONS,
    LIVE_WORLD,
    LiveAlarm,
    LiveClosure,
    LiveMission,
    LiveMissions,
    LiveMissionsQuery,
    LivePad,
    LiveStation,
    LiveStep,
    LiveWorld,
)
from skyway.contracts.mission import Mission
from skyway.ids import PackageId
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition import alarm_store
from skyway_composition.alarm_store import Alarm, AlarmFilter
from skyway_composition.closures.closure import Closure
from skyway_composition.closures.store import not_over
from skyway_composition.live.live_store import missions_with_steps, open_alarms, open_missions
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.share_views import missions_seen, own_steps
from skyway_composition.missions.mission.step_store import StepRecord
from skyway_composition.networks.station_store import StationRow, stations_named
from skyway_composition.pads.occupancy import Occupancy, PadOccupancy, outages_by_pad, uses_by_pad
from skyway_composition.pads.store import held_now, occupied_stations

#: The newest open alarms that are shown; more would not fit on any screen.
_MOST_ALARMS: Final = 500


def live_routes(*, db: Database, gate: ServiceGate, clock: FleetClock) -> ServiceRouter:
    """GET /internal/live/world and POST /internal/live/missions."""
    router = ServiceRouter(tags=("internal",))

    @router.get(LIVE_WORLD, response_model=LiveWorld)
    async def get_live_world(caller: Annotated[Caller, Depends(gate)]) -> Response:
        """The versions of all open missions, and all stations in use, closures and open alarms."""
        caller.must_be_service("gateway")
        now_ms = moment_to_ms(clock.now())
        async with db.read() as connection:
            missions = await open_missions(connection)
            occupied = await occupied_stations(connection, at_ms=now_ms)
            stations = await stations_named(connection, occupied) if occupied else {}
            held = await held_now(connection, at_ms=now_ms)
            closures = await not_over(connection, at_ms=now_ms)
            alarms = await alarm_store.page(
                connection, AlarmFilter(state="OPEN"), before=None, limit=_MOST_ALARMS
            )
            most_alarms = len(alarms) == _MOST_ALARMS
            open_count = await open_alarms(connection) if most_alarms else len(alarms)
        uses = uses_by_pad(
            held, outages_by_pad(each for each in closures if each.from_ms <= now_ms)
        )
        world = LiveWorld.model_construct(
            missions=missions,
            stations=tuple(
                live_station(station, occupied[station_id], uses.get(station_id, {}))
                for station_id, station in stations.items()
            ),
            closures=tuple(map(live_closure, closures)),
            alarms=tuple(map(live_alarm, alarms)),
            open_alarms=open_count,
        )
        # Serialized here: the answer is valid, and FastAPI would validate all of it again.
        return Response(world.model_dump_json(exclude_none=True), media_type="application/json")

    @router.post(LIVE_MISSIONS, response_model=LiveMissions)
    async def read_live_missions(
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[LiveMissionsQuery, Depends(internal_body(LiveMissionsQuery))],
    ) -> Response:
        """Those of these missions that are not over, with their steps."""
        caller.must_be_service("gateway")
        async with db.read() as connection:
            found = await missions_with_steps(connection, query.mission_ids)
        asked = set(query.mission_ids)
        answer = LiveMissions.model_construct(
            missions=tuple(
                each
                for record, steps in found
                for each in live_missions(record, steps)
                if each.mission_id in asked
            )
        )
        return Response(answer.model_dump_json(exclude_none=True), media_type="application/json")

    return router


def live_missions(record: MissionRecord, steps: Sequence[StepRecord]) -> Iterator[LiveMission]:
    """A mission as each of its deliveries sees it: with its own packages and hand-overs only."""
    for mission in missions_seen(record):
        yield _live_mission(record, mission, own_steps(record, mission.delivery_id, steps))


def _live_mission(
    record: MissionRecord, mission: Mission, steps: Sequence[StepRecord]
) -> LiveMission:
    """A mission with its steps as they were flown, or as they are planned."""
    on_board = _on_board(steps)
    return LiveMission.model_construct(
        mission_id=mission.mission_id,
        delivery_id=mission.delivery_id,
        flown_as=record.mission_id if mission.mission_id != record.mission_id else None,
        provider_id=mission.provider_id,
        drone_id=mission.drone_id,
        state=mission.state,
        revision=mission.revision,
        packages=mission.packages,
        trouble=_trouble_of(record),
        doubt=None if mission.doubt is None else mission.doubt.code,
        is_held=mission.is_held,
        is_carrying=bool(on_board),
        service_steps=_service_steps(steps, has_load=bool(on_board)),
        steps=tuple(_live_steps(steps)),
    )


def _trouble_of(record: MissionRecord) -> str | None:
    if record.stuck is not None:
        return record.stuck.code
    return None if record.trouble is None else record.trouble.code


def _on_board(steps: Sequence[StepRecord]) -> set[PackageId]:
    """The packages that were loaded and not handed over yet."""
    found: set[PackageId] = set()
    for each in steps:
        if each.status == "ENDED":
            if isinstance(each.step, PickUpStep):
                found |= set(packages_of(each.step))
            else:
                found -= set(packages_of(each.step))
        elif isinstance(each.step, DeliverStep) and each.event is not None:
            found -= set(each.event.package_ids)  # those that had their proofs
    return found


def _service_steps(steps: Sequence[StepRecord], *, has_load: bool) -> int:
    """How many steps there are up to the last hand-over; all if a load has none planned."""
    last = 0
    is_planned = False
    for number, each in enumerate(steps, 1):
        if isinstance(each.step, DeliverStep | ReturnStep):
            last, is_planned = number, each.status == "PLANNED"
    return len(steps) if has_load and not is_planned else last


def _live_steps(steps: Sequence[StepRecord]) -> Iterator[LiveStep]:
    """The steps, each where it is done; a stop is where the flight before it has ended."""
    here = next((each.step.from_position for each in steps if isinstance(each.step, FlyStep)), None)
    for each in steps:
        step, event = each.step, each.event
        start = None
        if isinstance(step, FlyStep):
            start, here = step.from_position, step.to_position
        place = event.position if event is not None and here is None else here
        if place is None:
            continue  # a mission without a flight has no way to show
        yield LiveStep.model_construct(
            step_id=step.step_id,
            kind=step.kind,
            status=each.status,
            station_id=end_of(step),
            position=place,
            from_position=start,
            pad=getattr(step, "pad", None),
            lands=step.lands if isinstance(step, FlyStep) else None,
            start_at=(event and event.started_at) or step.planned_start_at,
            end_at=step.planned_end_at if event is None else event.ended_at,
            package_ids=packages_of(step),
        )


def live_station(
    station: StationRow, use: Occupancy, uses: Mapping[int, PadOccupancy]
) -> LiveStation:
    """A station with its occupied pads."""
    return LiveStation.model_construct(
        station_id=station.station_id,
        network_id=station.network_id,
        position=station.position,
        pads=use.pads,
        pads_taken=use.pads_taken,
        # A network that was published again may have fewer pads than are still reserved.
        taken={pad: _live_pad(each) for pad, each in uses.items() if pad < use.pads},
        queue=use.queue,
        next_free_at=None if use.next_free_ms is None else ms_to_moment(use.next_free_ms),
    )


def _live_pad(use: PadOccupancy) -> LivePad:
    outage, held_until_ms = use.outage, use.held_until_ms
    works_again_ms = None if outage is None else outage.until_ms
    return LivePad.model_construct(
        taken_until_at=None if held_until_ms is None else ms_to_moment(held_until_ms),
        is_out_of_order=outage is not None,
        works_again_at=None if works_again_ms is None else ms_to_moment(works_again_ms),
    )


def live_closure(closure: Closure) -> LiveClosure:
    """A closure of any kind."""
    return LiveClosure.model_construct(
        closure_id=closure.closure_id,
        kind=closure.kind,
        from_at=ms_to_moment(closure.from_ms),
        until=None if closure.until_ms is None else ms_to_moment(closure.until_ms),
        network_id=closure.network_id,
        station_id=closure.station_id,
        pad=closure.pad,
        to_station_id=closure.to_station_id,
        rings=None if closure.area is None else closure.area.coordinates,
        provider_id=closure.provider_id,
        drone_model_id=closure.drone_model_id,
        reason=closure.reason,
    )


def live_alarm(alarm: Alarm) -> LiveAlarm:
    """An alarm without the numbers behind it, which its own page shows."""
    return LiveAlarm.model_construct(
        **{each: getattr(alarm, each) for each in LiveAlarm.model_fields}
    )
