"""Fleets over REST: providers see, count, change and remove their own drones."""

from typing import Annotated, Final

from fastapi import Depends, Query, Response

from skyway.errors import InvalidInput
from skyway.ids import DroneId, ProviderId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.problem_answers import conflicts
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_provider_registry.enrolment import account_store as accounts
from skyway_provider_registry.enrolment.password_file import PasswordFile
from skyway_provider_registry.fleets import statistics_store, store
from skyway_provider_registry.fleets.drone import Drone, DroneChange
from skyway_provider_registry.fleets.registration import StationLookup
from skyway_provider_registry.fleets.statistics_store import FleetStatistics, totals
from skyway_provider_registry.presence.drone_presence import SILENCE
from skyway_provider_registry.providers import store as providers

#: The changes that are columns of the same name and value.
_PLAIN_FIELDS: Final = frozenset(("name", "registration", "standby"))


def fleet_routes(
    *,
    db: Database,
    gate: ServiceGate,
    clock: FleetClock,
    stations: StationLookup,
    password_file: PasswordFile,
) -> ServiceRouter:
    """GET, PATCH and DELETE of /v1/providers/{provider_id}/drones and /{drone_id}."""
    router = ServiceRouter(tags=("drones",), prefix="/v1/providers/{provider_id}/drones")

    @router.get("")
    async def list_drones(
        provider_id: ProviderId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[PageQuery, Query()],
    ) -> Page[Drone]:
        """List the drones of a provider, by id."""
        caller.must_be("operator", "provider")
        async with db.read() as connection:
            await providers.of_caller(connection, caller, provider_id=provider_id)
            drones = await store.page_of_caller(
                connection, caller, provider_id=provider_id, query=query
            )
        wall_now = clock.wall_now()
        return page_of(
            drones,
            query,
            item=lambda drone: drone.shown(wall_now),
            sort_key=lambda drone: (drone.drone_id,),
        )

    @router.get("/{drone_id}")
    async def get_drone(
        provider_id: ProviderId, drone_id: DroneId, caller: Annotated[Caller, Depends(gate)]
    ) -> Drone:
        """Show a drone and its present state; a drone sees itself."""
        caller.must_be("operator", "provider", "drone")
        async with db.read() as connection:
            drone = await store.of_caller(
                connection, caller, provider_id=provider_id, drone_id=drone_id
            )
        return drone.shown(clock.wall_now())

    @router.patch("/{drone_id}", responses=conflicts("REGISTRATION_TAKEN"))
    async def update_drone(
        provider_id: ProviderId,
        drone_id: DroneId,
        caller: Annotated[Caller, Depends(gate)],
        requested: DroneChange,
    ) -> Drone:
        """Change a drone's own data, or take it out of service and back."""
        caller.must_be("operator", "provider")
        values = await _columns(requested, stations)
        async with db.write() as tx:
            await store.change(
                tx, caller, provider_id=provider_id, drone_id=drone_id, values=values
            )
            drone = await store.of_caller(
                tx.connection, caller, provider_id=provider_id, drone_id=drone_id
            )
        return drone.shown(clock.wall_now())

    @router.delete("/{drone_id}", status_code=204, responses=conflicts("ON_MISSION"))
    async def delete_drone(
        provider_id: ProviderId, drone_id: DroneId, caller: Annotated[Caller, Depends(gate)]
    ) -> Response:
        """Remove a drone that is on no mission, and its broker account."""
        caller.must_be("operator", "provider")
        async with db.write() as tx:
            drone = await store.of_caller(
                tx.connection, caller, provider_id=provider_id, drone_id=drone_id
            )
            if (mission_id := drone.presence.mission_id) is not None:
                raise Conflict("ON_MISSION", f"drone {drone_id} is on mission {mission_id}")
            await store.remove(tx, caller, provider_id=provider_id, drone_id=drone_id)
            await accounts.remove_drone(tx, drone_id)
        await password_file.refresh()
        return Response(status_code=204)

    return router


async def _columns(requested: DroneChange, stations: StationLookup) -> dict[str, object]:
    """The columns to set; a new home station is looked up before the write."""
    given = requested.model_fields_set
    values: dict[str, object] = {f: getattr(requested, f) for f in given & _PLAIN_FIELDS}
    if requested.state is not None:
        values["is_in_maintenance"] = requested.state == "MAINTENANCE"
    if requested.home_station_id is not None:
        check = await stations.check([requested.home_station_id])
        if check.unknown:
            raise InvalidInput(
                "home_station_id", f"no station is called {requested.home_station_id!r}"
            )
        position = check.positions[requested.home_station_id]
        values["home_station_id"] = requested.home_station_id
        values["home_longitude_deg"] = position.longitude_deg
        values["home_latitude_deg"] = position.latitude_deg
    return values


def fleet_statistics_routes(*, db: Database, gate: ServiceGate, clock: FleetClock) -> ServiceRouter:
    """GET /v1/stats/fleets."""
    router = ServiceRouter(tags=("statistics",))

    @router.get("/v1/stats/fleets")
    async def get_fleet_statistics(caller: Annotated[Caller, Depends(gate)]) -> FleetStatistics:
        """Count the drones in each state, and measure how late their messages arrive.

        Also shows when the next busy drone is free.
        """
        caller.must_be("provider", "operator")
        provider_id = ProviderId(caller.subject_id) if caller.role == "provider" else None
        now, since_ms = clock.now(), moment_to_ms(clock.wall_now() - SILENCE)
        async with db.read() as connection:
            rows = await statistics_store.groups(
                connection, provider_id, received_since_wall_ms=since_ms
            )
            next_free_ms = await statistics_store.next_free_ms(
                connection, provider_id, now_ms=moment_to_ms(now)
            )
        return totals(rows, at=now, rate=clock.rate, next_free_ms=next_free_ms)

    return router
