"""All SQL of closure impact: it reads indexed columns of steps, not their JSON."""

import json
from collections.abc import Collection
from typing import Any, Final

from sqlalchemy import ColumnElement, Row, Select, and_, select, text, true, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DroneId, DroneModelId, MissionId, NetworkId, ProviderId, StationId
from skyway.runtime.sql.database import Tx
from skyway_composition.missions.closure_impact.hits import (
    DroneActivity,
    HeldPad,
    Owner,
    PlannedFlight,
)
from skyway_composition.missions.mission.record import Proposal
from skyway_composition.tables import (
    drone_links,
    is_live,
    mission_steps,
    missions,
    pad_reservations,
)

#: A connection to read from, inside or outside a transaction.
Reader = AsyncConnection

#: With more stations than this all flights are read: listing the stations takes longer.
_MOST_NAMED: Final = 5_000

# Written as text, because a partial index is used only if the statement has its exact condition.
_is_to_fly = text("mission_steps.status = 'PLANNED' AND mission_steps.kind = 'FLY'")

_WHOSE: Final = (
    missions.c.mission_id,
    missions.c.drone_id,
    missions.c.provider_id,
    missions.c.delivery_id,
)


async def flights_to(
    connection: Reader,
    station_ids: Collection[StationId],
    *,
    network_id: NetworkId | None,
    start_before_ms: int | None,
) -> list[PlannedFlight]:
    """The flights of live missions to these stations that begin before a moment."""
    is_there: ColumnElement[bool] = true()
    if len(station_ids) <= _MOST_NAMED:
        is_there = mission_steps.c.to_station_id.in_(station_ids)
    query = _flights(network_id).where(is_there)
    if start_before_ms is not None:
        query = query.where(mission_steps.c.planned_start_ms < start_before_ms)
    return [_flight(row) for row in await connection.execute(query)]


async def flights_of_network(connection: Reader, network_id: NetworkId) -> list[PlannedFlight]:
    """All flights of live missions in a network that have not ended."""
    return [_flight(row) for row in await connection.execute(_flights(network_id))]


async def take_offs(
    connection: Reader,
    *,
    network_id: NetworkId | None,
    provider_id: ProviderId | None,
) -> list[PlannedFlight]:
    """The flights of live missions that begin with a take-off, of one provider or of all."""
    before = mission_steps.alias("before")
    flies_through = (
        select(before.c.step_id)
        .where(
            before.c.mission_id == mission_steps.c.mission_id,
            before.c.step_id == mission_steps.c.step_id - 1,
            before.c.kind == "FLY",
            ~before.c.lands,
        )
        .exists()
    )
    query = _flights(network_id).where(~flies_through)
    if provider_id is not None:
        query = query.where(missions.c.provider_id == provider_id)
    return [_flight(row) for row in await connection.execute(query)]


async def pads_held(connection: Reader, station_id: StationId, pad: int) -> list[HeldPad]:
    """The reservations of a pad."""
    held = pad_reservations.c
    found = await connection.execute(
        select(*_WHOSE, held.start_ms, held.end_ms)
        .join(pad_reservations, held.mission_id == missions.c.mission_id)
        .where(held.station_id == station_id, held.pad == pad, is_live)
    )
    return [HeldPad(_owner(row), station_id, row.start_ms, row.end_ms) for row in found]


async def pads_held_at(connection: Reader, station_ids: Collection[StationId]) -> list[HeldPad]:
    """The reservations of all pads of these stations."""
    held = pad_reservations.c
    is_there: ColumnElement[bool] = true()
    if len(station_ids) <= _MOST_NAMED:
        is_there = held.station_id.in_(station_ids)
    found = await connection.execute(
        select(*_WHOSE, held.station_id, held.start_ms, held.end_ms)
        .join(pad_reservations, held.mission_id == missions.c.mission_id)
        .where(is_there, is_live)
    )
    return [
        HeldPad(_owner(row), row.station_id, row.start_ms, row.end_ms)
        for row in found
        if row.station_id in station_ids
    ]


async def proposals(
    connection: Reader, network_id: NetworkId | None
) -> list[tuple[Owner, Proposal]]:
    """The proposals that wait for their drones' answers."""
    query = select(*_WHOSE, missions.c.proposal).where(is_live, missions.c.proposal.is_not(None))
    if network_id is not None:
        query = query.where(missions.c.network_id == network_id)
    found = await connection.execute(query)
    return [(_owner(row), Proposal.read(row.proposal)) for row in found]


async def drones_of_model(
    connection: Reader, drone_ids: Collection[DroneId], model_id: DroneModelId
) -> frozenset[DroneId]:
    """Which of these drones on missions are of this model."""
    found = await connection.execute(
        select(missions.c.drone_id, missions.c.candidate).where(
            missions.c.drone_id.in_(drone_ids), is_live
        )
    )
    models = {row.drone_id: json.loads(row.candidate)["model"]["model_id"] for row in found}
    return frozenset(drone_id for drone_id, found_id in models.items() if found_id == model_id)


async def activities_of(
    connection: Reader, drone_ids: Collection[DroneId]
) -> dict[DroneId, DroneActivity]:
    """The last reported activities of these drones."""
    found = await connection.execute(
        select(drone_links.c.drone_id, drone_links.c.state).where(
            drone_links.c.drone_id.in_(drone_ids), drone_links.c.state.is_not(None)
        )
    )
    # Only three members are needed: reading states as models takes four times as long.
    states = {row.drone_id: json.loads(row.state) for row in found}
    return {
        drone_id: DroneActivity(
            mission_id=state.get("mission_id"),
            step_id=state.get("step_id"),
            is_flying=state["activity"] == "FLYING",
        )
        for drone_id, state in states.items()
    }


async def replan_waiting(tx: Tx, network_id: NetworkId | None) -> None:
    """Plan immediately for all missions that wait for another plan."""
    waits = missions.c.stuck.is_not(None) | missions.c.trouble.is_not(None)
    where = and_(is_live, waits)
    if network_id is not None:
        where = and_(where, missions.c.network_id == network_id)
    await tx.execute(update(missions).where(where).values(retry_wall_ms=0))


async def without_trouble(
    connection: Reader, mission_ids: Collection[MissionId]
) -> frozenset[MissionId]:
    """Which of these missions have no trouble."""
    found = await connection.execute(
        select(missions.c.mission_id).where(
            missions.c.mission_id.in_(mission_ids), missions.c.trouble.is_(None)
        )
    )
    return frozenset(found.scalars())


def _flights(network_id: NetworkId | None) -> Select[Any]:
    step = mission_steps.c
    query = (
        select(
            *_WHOSE,
            step.step_id,
            step.from_station_id,
            step.to_station_id,
            step.lands,
            step.planned_start_ms,
            step.planned_end_ms,
        )
        .join(mission_steps, step.mission_id == missions.c.mission_id)
        .where(_is_to_fly, is_live)
    )
    if network_id is not None:
        query = query.where(missions.c.network_id == network_id)
    return query


def _flight(row: Row[*tuple[Any, ...]]) -> PlannedFlight:  # a row of `_flights`
    return PlannedFlight(
        _owner(row),
        row.step_id,
        row.from_station_id,
        row.to_station_id,
        row.lands,
        row.planned_start_ms,
        row.planned_end_ms,
    )


def _owner(row: Row[*tuple[Any, ...]]) -> Owner:  # a row that begins with `_WHOSE`
    return Owner(row.mission_id, row.drone_id, row.provider_id, row.delivery_id)
