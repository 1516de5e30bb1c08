"""The gateway reads missions, pads, closures and alarms for its live picture."""

from typing import Annotated, Final

from fastapi import Depends, Response

from skyway.contracts.live import (
    LIVE_MISSIONS,
    LIVE_WORLD,
    LiveMissions,
    LiveMissionsQuery,
    LiveWorld,
)
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition import alarm_store
from skyway_composition.alarm_store import AlarmFilter
from skyway_composition.closures.store import not_over
from skyway_composition.live.live_store import missions_with_steps, open_alarms, open_missions
from skyway_composition.live.present import live_alarm, live_closure, live_missions, live_station
from skyway_composition.networks.station_store import stations_named
from skyway_composition.pads.occupancy import outages_by_pad, uses_by_pad
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
