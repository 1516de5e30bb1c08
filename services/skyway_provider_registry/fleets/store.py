"""All SQL of the fleets and of drone models; a query finds only drones that its caller may see."""

from collections.abc import Collection, Mapping, Sequence
from datetime import datetime
from typing import Final

from sqlalchemy import ColumnElement, delete, func, select, true, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.drones import OutOfServiceAnswer
from skyway.drone.model import DroneModel
from skyway.drone.models import DRONE_MODELS
from skyway.geo import Position
from skyway.ids import DroneId, DroneModelId, ProviderId
from skyway.runtime.errors import Conflict, NotFound, RowRefused
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import PageQuery
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway.units import moment_to_ms, ms_to_moment
from skyway_provider_registry.change_store import mark_removal
from skyway_provider_registry.fleets.drone import Drone, DroneStateName, FleetDrone, NewDrone
from skyway_provider_registry.presence.learned_store import LEARNED_COLUMNS, shown, with_learned
from skyway_provider_registry.presence.maintenance_store import maintenance_of
from skyway_provider_registry.presence.store import (
    IS_LAST_MISSION,
    LAST_MISSION,
    PRESENCE,
    free_from_of,
    presence_of,
    touch,
)
from skyway_provider_registry.providers.store import owned
from skyway_provider_registry.tables import drone_models, drones, providers

#: The drone models that one provider may add: all are read wherever drones are.
MOST_MODELS: Final = 50

#: Registrations in one IN list.
_CHUNK: Final = 500

_presence = PRESENCE.subquery("drone_presence")
_free = tuple(LAST_MISSION.c[name] for name in ("free_ms", "free_station_id", "free_soc"))
_fleet = select(
    drones, *(c for c in _presence.c if c.name != "drone_id"), *_free, *LEARNED_COLUMNS
).select_from(
    with_learned(drones.join(_presence, _presence.c.drone_id == drones.c.drone_id)).outerjoin(
        LAST_MISSION, IS_LAST_MISSION
    )
)

Models = Mapping[DroneModelId, DroneModel]


async def add(tx: Tx, new_drones: Sequence[FleetDrone]) -> None:
    """Store new drones.

    Raises
    ------
    Conflict
        The provider has a drone with one of these registrations.
    """
    await _refuse_duplicate_registrations(tx, new_drones)
    rows = [
        {
            "drone_id": drone.drone_id,
            "provider_id": drone.provider_id,
            "model_id": drone.model.model_id,
            "home_station_id": drone.home_station_id,
            "home_longitude_deg": drone.home_position.longitude_deg,
            "home_latitude_deg": drone.home_position.latitude_deg,
            "network_id": drone.network_id,
            "name": drone.name,
            "registration": drone.registration,
            "standby": drone.standby,
            "initial_soc": drone.initial_soc,
            "is_in_maintenance": drone.is_in_maintenance,
            "created_ms": moment_to_ms(drone.created_at),
        }
        for drone in new_drones
    ]
    try:
        await tx.execute(drones.insert(), rows)
    except RowRefused as error:
        raise _conflict("of one of these drones") from error


async def of_caller(
    connection: AsyncConnection, caller: Caller, *, provider_id: ProviderId, drone_id: DroneId
) -> FleetDrone:
    """A drone of this provider, if the caller may see it.

    Raises
    ------
    NotFound
        There is no such drone, or the caller may not see it.
    """
    statement = _fleet.where(_is_own(caller, provider_id), drones.c.drone_id == drone_id)
    row = (await connection.execute(statement)).one_or_none()
    if row is None:
        raise NotFound("drone", drone_id)
    return _drone(row, await every_model(connection))


async def by_id(connection: AsyncConnection, drone_id: DroneId) -> FleetDrone:
    """The drone with this id, for any caller.

    Raises
    ------
    NotFound
        There is no such drone.
    """
    row = (await connection.execute(_fleet.where(drones.c.drone_id == drone_id))).one_or_none()
    if row is None:
        raise NotFound("drone", drone_id)
    return _drone(row, await every_model(connection))


async def page_of_caller(
    connection: AsyncConnection, caller: Caller, *, provider_id: ProviderId, query: PageQuery
) -> Sequence[FleetDrone]:
    """Up to limit + 1 drones of this provider that the caller may see, sorted by id."""
    return await _page(
        connection,
        _is_own(caller, provider_id),
        after=query.after_id(),
        limit=query.limit + 1,
    )


async def page_of_all(
    connection: AsyncConnection, *, provider_id: ProviderId | None, after: str | None, limit: int
) -> Sequence[FleetDrone]:
    """Up to `limit` drones of all providers, or of this one, sorted by id."""
    of_provider = true() if provider_id is None else drones.c.provider_id == provider_id
    return await _page(connection, of_provider, after=after, limit=limit)


async def _page(
    connection: AsyncConnection, which: ColumnElement[bool], *, after: str | None, limit: int
) -> Sequence[FleetDrone]:
    statement = _fleet.where(which).order_by(drones.c.drone_id).limit(limit)
    if after is not None:
        statement = statement.where(drones.c.drone_id > after)
    models = await every_model(connection)
    return [_drone(row, models) for row in await connection.execute(statement)]


async def change(
    tx: Tx,
    caller: Caller,
    *,
    provider_id: ProviderId,
    drone_id: DroneId,
    values: Mapping[str, object],
) -> None:
    """Set these columns of a drone, if the caller may change it.

    Raises
    ------
    NotFound
        There is no such drone, or the caller may not see it.
    Conflict
        The provider has another drone with this registration.
    """
    await touch(tx, drone_id)
    condition = _is_own(caller, provider_id) & (drones.c.drone_id == drone_id)
    # Without values this still checks that the drone exists.
    statement = update(drones).where(condition).values(values or {"name": drones.c.name})
    try:
        found = await tx.execute(statement)
    except RowRefused as error:
        raise _conflict(repr(values["registration"])) from error
    if found.rowcount == 0:
        raise NotFound("drone", drone_id)


async def remove(tx: Tx, caller: Caller, *, provider_id: ProviderId, drone_id: DroneId) -> None:
    """Delete a drone, if the caller may change it, with its presence."""
    await mark_removal(tx)
    condition = _is_own(caller, provider_id) & (drones.c.drone_id == drone_id)
    if (await tx.execute(delete(drones).where(condition))).rowcount == 0:
        raise NotFound("drone", drone_id)


async def _refuse_duplicate_registrations(tx: Tx, new_drones: Sequence[FleetDrone]) -> None:
    """Find the registration that another drone has; the error of the database names none."""
    for provider_id in {drone.provider_id for drone in new_drones}:
        taken = await taken_registrations(tx.connection, provider_id, new_drones)
        if taken:
            raise _conflict(repr(min(taken)))


async def taken_registrations(
    connection: AsyncConnection,
    provider_id: ProviderId,
    new_drones: Sequence[FleetDrone | NewDrone],
) -> set[str]:
    """The registrations of these drones that other drones of the provider have."""
    registrations = [drone.registration for drone in new_drones if drone.registration is not None]
    taken: set[str] = set()
    for start in range(0, len(registrations), _CHUNK):
        duplicates = select(drones.c.registration).where(
            drones.c.provider_id == provider_id,
            drones.c.registration.in_(registrations[start : start + _CHUNK]),
        )
        taken |= set((await connection.execute(duplicates)).scalars())
    return taken


def _conflict(registration: str) -> Conflict:
    return Conflict(
        "REGISTRATION_TAKEN", f"registration {registration} belongs to another of your drones"
    )


def _is_own(caller: Caller, provider_id: ProviderId) -> ColumnElement[bool]:
    of_provider = drones.c.provider_id == provider_id
    if caller.role == "drone":
        return of_provider & (drones.c.drone_id == caller.subject_id)
    return of_provider & owned(caller, drones.c.provider_id)


def _drone(row: AnyRow, models: Mapping[DroneModelId, DroneModel]) -> FleetDrone:
    return FleetDrone(
        drone_id=row.drone_id,
        provider_id=row.provider_id,
        model=models[row.model_id],
        home_station_id=row.home_station_id,
        home_position=Position(row.home_longitude_deg, row.home_latitude_deg),
        name=row.name,
        registration=row.registration,
        standby=row.standby,
        initial_soc=row.initial_soc,
        is_in_maintenance=row.is_in_maintenance,
        created_at=ms_to_moment(row.created_ms),
        presence=presence_of(row),
        free_from=free_from_of(row),
        network_id=row.network_id,
        learned=shown(row),
        battery_id=row.battery_id,
        maintenance=maintenance_of(row),
    )


async def every_model(connection: AsyncConnection) -> Models:
    """All models, sorted by id."""
    found = await connection.execute(select(drone_models.c.model))
    added = [DroneModel.read(text) for text in found.scalars()]
    models = {**{model.model_id: model for model in added}, **DRONE_MODELS}
    return dict(sorted(models.items()))


async def model_owners(connection: AsyncConnection) -> Mapping[DroneModelId, ProviderId]:
    """The owner of each model that is not in the catalogue: no other provider may use it."""
    owned = drone_models.c.provider_id.is_not(None)
    query = select(drone_models.c.model_id, drone_models.c.provider_id).where(owned)
    return {row.model_id: row.provider_id for row in await connection.execute(query)}


async def usable_models(connection: AsyncConnection, provider_id: ProviderId) -> Models:
    """The models of the catalogue and the provider's own, sorted by id."""
    owners, models = await model_owners(connection), await every_model(connection)
    return {
        model_id: model
        for model_id, model in models.items()
        if owners.get(model_id, provider_id) == provider_id
    }


async def put_model(tx: Tx, model: DroneModel, caller: Caller) -> bool:
    """Store a model under its id; True when the id is new.

    A provider's new model is its own. What an operator stores is in the catalogue from then on,
    also with the values that it had: so a provider cannot change a model while it is approved.

    Raises
    ------
    Conflict
        The id belongs to another model of the library, to a model that the calling provider did
        not add, or to a model of registered drones: the abilities of these drones must not change
        while plans use them. Or the provider has as many models as it may have.
    """
    previous = (await every_model(tx.connection)).get(model.model_id)
    if previous == model and (caller.role == "provider" or model.model_id in DRONE_MODELS):
        return False
    if model.model_id in DRONE_MODELS:
        raise Conflict("NAMED_MODEL", f"{model.model_id} is one of Skyway's own drone models")
    if previous not in (None, model) and await _has_drones(tx, model.model_id):
        raise Conflict(
            "MODEL_IN_USE", f"drones of model {model.model_id} are registered: choose another id"
        )
    provider_id = caller.subject_id if caller.role == "provider" else None
    may_replace = true() if provider_id is None else drone_models.c.provider_id == provider_id
    if previous is None and provider_id is not None:
        await _refuse_too_many_models(tx, provider_id)
    row = {
        "model_id": model.model_id,
        "model": model.model_dump_json(),
        "provider_id": provider_id,
    }
    statement = tx.insert(drone_models).values(row)
    stored = await tx.execute(
        statement.on_conflict_do_update(
            index_elements=["model_id"],
            set_={name: statement.excluded[name] for name in ("model", "provider_id")},
            where=may_replace,
        ).returning(drone_models.c.model_id)
    )
    if stored.one_or_none() is None:
        raise Conflict("OTHERS_MODEL", f"{model.model_id} was added by somebody else")
    return previous is None


async def _refuse_too_many_models(tx: Tx, provider_id: str) -> None:
    statement = select(func.count()).where(drone_models.c.provider_id == provider_id)
    if (await tx.execute(statement)).scalar_one() >= MOST_MODELS:
        detail = f"the limit is {MOST_MODELS} drone models of a provider"
        raise Conflict("TOO_MANY_MODELS", detail)


async def _has_drones(tx: Tx, model_id: DroneModelId) -> bool:
    statement = select(drones.c.drone_id).where(drones.c.model_id == model_id).limit(1)
    row: AnyRow | None = (await tx.execute(statement)).one_or_none()
    return row is not None


async def out_of_service(
    connection: AsyncConnection, drone_ids: Collection[DroneId]
) -> OutOfServiceAnswer:
    """Which of these drones get no missions: out of service, or due for maintenance."""
    is_in_service = (
        in_list(drones.c.drone_id, "drone_ids"),
        drones.c.is_in_maintenance.is_(False),
        providers.c.state == "ACTIVE",
    )
    query = (
        select(drones.c.drone_id, drones.c.maintenance_due_ms)
        .join(providers, providers.c.provider_id == drones.c.provider_id)
        .where(*is_in_service)
    )
    found = await connection.execute(query, {"drone_ids": sorted(drone_ids)})
    due_since_ms = {row.drone_id: row.maintenance_due_ms for row in found}
    return OutOfServiceAnswer(
        drone_ids=tuple(each for each in drone_ids if each not in due_since_ms),
        due_drone_ids=tuple(each for each in drone_ids if due_since_ms.get(each) is not None),
    )


#: Drones that are read together while those of one state are searched.
_READ_TOGETHER: Final = 500


async def page(
    connection: AsyncConnection,
    query: PageQuery,
    *,
    provider_id: ProviderId | None,
    state: DroneStateName | None,
    wall_now: datetime,
) -> Sequence[Drone]:
    """Up to limit + 1 drones, sorted by id.

    The state of a drone is not stored but decided here, so drones in other states are read, too.
    """
    after = query.after_id()
    together = query.limit + 1 if state is None else _READ_TOGETHER
    found: list[Drone] = []
    while len(found) <= query.limit:
        read = await page_of_all(connection, provider_id=provider_id, after=after, limit=together)
        shown = [drone.shown(wall_now) for drone in read]
        found += [drone for drone in shown if state in (None, drone.state)]
        if len(read) < together:
            break
        after = read[-1].drone_id
    return found[: query.limit + 1]
