"""All SQL of the missions: their records, steps and custody."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Any, Final

from pydantic import TypeAdapter
from sqlalchemy import Row, bindparam, delete, insert, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.candidate import Candidate
from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import FlightStep
from skyway.contracts.mission import Mission
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, DroneId, MissionId, PackageId, ProviderId
from skyway.runtime.sql.among import among
from skyway.runtime.sql.claims import FREE
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_composition.missions.custody.chain import Custodian, Held
from skyway_composition.missions.known_json import KnownJson
from skyway_composition.missions.record import Aim, MissionRecord, Proposal, Stuck, Trouble
from skyway_composition.missions.steps.step_columns import step_columns
from skyway_composition.missions.steps.step_record import StepRecord, read_step
from skyway_composition.tables import (
    custody,
    first_planned_end_ms,
    is_live,
    mission_steps,
    missions,
)

_AIMS: Final = TypeAdapter(tuple[Aim, ...])

# A mission is read again soon after it was written, and its request never changes.
_MISSIONS: Final = KnownJson(Mission)
_REQUESTS: Final = KnownJson(DeliveryRequest)
_CANDIDATES: Final = KnownJson(Candidate)

#: An event that names no revision is of whichever is known.
_ANY_REVISION: Final = 2**31 - 1

# Statements that each booking and each word of a drone needs: making them takes longer than
# running them does.
_LIVE: Final = (
    select(missions)
    .where(among(missions.c.drone_id, "drone_ids"), is_live)
    .order_by(missions.c.drone_id)
    .with_for_update()
)
_LIVE_AMONG: Final = select(missions.c.drone_id).where(
    among(missions.c.drone_id, "drone_ids"), is_live
)
_LIVE_DRONES: Final = select(missions.c.drone_id).where(is_live).order_by(missions.c.drone_id)
# Its steps change before a mission is saved; what its drone does next is kept at each of these.
_SAVE: Final = (
    update(missions)
    .where(missions.c.mission_id == bindparam("of_mission"))
    .values(next_end_ms=first_planned_end_ms)
)
_ADD_STEPS: Final = insert(mission_steps)
_PLANNED_STEP: Final = select(mission_steps.c.step).where(
    mission_steps.c.mission_id == bindparam("mission_id"),
    mission_steps.c.step_id == bindparam("step_id"),
    mission_steps.c.status == "PLANNED",
    # A step that was cut has the number of the one in its place, which came later.
    mission_steps.c.revision <= bindparam("revision"),
)
_END_STEP: Final = update(mission_steps).where(
    mission_steps.c.mission_id == bindparam("of_mission"),
    mission_steps.c.step_id == bindparam("of_step"),
)
_STEPS: Final = (
    select(mission_steps)
    .where(mission_steps.c.mission_id == bindparam("mission_id"))
    .order_by(mission_steps.c.step_id)
)
_CHAIN: Final = (
    select(custody).where(custody.c.delivery_id == bindparam("delivery_id")).order_by(custody.c.seq)
)
_ADD_CUSTODY: Final = insert(custody)


@dataclass(frozen=True, slots=True)
class MissionFilter:
    """Which missions a list shows; `provider_id` is the caller's own, None for operators."""

    provider_id: ProviderId | None = None
    state: str | None = None
    delivery_id: str | None = None
    drone_id: str | None = None
    loading: str | None = None


async def live_missions_of(
    connection: AsyncConnection, delivery_id: DeliveryId
) -> tuple[Mission, ...]:
    """The missions that are under way for a delivery, or ended without refusing it."""
    found = await connection.execute(
        select(missions)
        .where(missions.c.delivery_id == delivery_id, missions.c.state != "REFUSED")
        .order_by(missions.c.attempt, missions.c.trip)
    )
    return tuple(_record(row).mission for row in found)


def add(tx: Tx, record: MissionRecord) -> None:
    """Add a mission when the block ends.

    Then `mission_drone` is `Taken` if its drone is on another one, `mission_attempt` if it was
    booked already.
    """
    mission = record.mission
    row = {
        "mission_id": mission.mission_id,
        "delivery_id": mission.delivery_id,
        "attempt": mission.attempt,
        "trip": mission.trip,
        "provider_id": mission.provider_id,
        "drone_id": mission.drone_id,
        "network_id": record.network_id,
        "request": _REQUESTS.write(record.request),
        "candidate": _CANDIDATES.write(record.candidate),
        **_changing(record),
    }
    tx.add(missions, [row])


async def save_all(tx: Tx, records: Iterable[MissionRecord]) -> None:
    """Keep what changed of missions that are locked, and of their steps before."""
    rows = [{"of_mission": record.mission_id, **_changing(record)} for record in records]
    if rows:
        await tx.execute(_SAVE, rows)


async def lock_live(tx: Tx, drone_ids: Collection[DroneId]) -> dict[DroneId, MissionRecord]:
    """The live missions of these drones; nobody else changes them meanwhile."""
    found = await tx.execute(_LIVE, {"drone_ids": [*drone_ids]})
    return {row.drone_id: _record(row) for row in found}


async def get(
    connection: AsyncConnection, mission_id: MissionId, *, provider_id: ProviderId | None
) -> MissionRecord | None:
    """A mission, if it is this provider's (None: whoever's)."""
    query = select(missions).where(missions.c.mission_id == mission_id)
    if provider_id is not None:
        query = query.where(missions.c.provider_id == provider_id)
    row = (await connection.execute(query)).one_or_none()
    return None if row is None else _record(row)


async def page(
    connection: AsyncConnection, shown: MissionFilter, *, before: str | None, limit: int
) -> list[MissionRecord]:
    """Missions, the newest first, those before a given id."""
    query = select(missions).order_by(missions.c.mission_id.desc()).limit(limit)
    for column, value in (
        (missions.c.provider_id, shown.provider_id),
        (missions.c.state, shown.state),
        (missions.c.delivery_id, shown.delivery_id),
        (missions.c.drone_id, shown.drone_id),
        (missions.c.loading, shown.loading),
    ):
        if value is not None:
            query = query.where(column == value)
    if before is not None:
        query = query.where(missions.c.mission_id < before)
    return [_record(row) for row in await connection.execute(query)]


async def live_among(
    connection: AsyncConnection, drone_ids: Collection[DroneId]
) -> frozenset[DroneId]:
    """Those of these drones that are on missions."""
    found = await connection.execute(_LIVE_AMONG, {"drone_ids": [*drone_ids]})
    return frozenset(found.scalars())


async def live_drones(connection: AsyncConnection) -> list[DroneId]:
    """The drones that are on missions."""
    found = await connection.execute(_LIVE_DRONES)
    return list(found.scalars())


async def retry_stuck(tx: Tx, mission_id: MissionId, *, at_wall_ms: int) -> None:
    """Give up the claim of a mission that waits for a revision; look again at this moment."""
    await tx.execute(
        update(missions)
        .where(missions.c.mission_id == mission_id)
        .values(retry_wall_ms=at_wall_ms, **FREE)
    )


async def save_troubles(tx: Tx, records: Iterable[MissionRecord]) -> None:
    """Keep the troubles of missions that are locked, and what was told of them; plan at once."""
    rows = [
        {
            "of_mission": record.mission_id,
            "trouble": None if record.trouble is None else record.trouble.model_dump_json(),
            "report_seq": record.report_seq,
        }
        for record in records
    ]
    if rows:
        of_mission = missions.c.mission_id == bindparam("of_mission")
        await tx.execute(update(missions).where(of_mission).values(retry_wall_ms=0), rows)


async def plan_at_once(tx: Tx, mission_id: MissionId) -> None:
    """Look for a plan without waiting any longer; whoever is at it keeps the claim."""
    await tx.execute(
        update(missions).where(missions.c.mission_id == mission_id).values(retry_wall_ms=0)
    )


def add_steps(tx: Tx, mission_id: MissionId, steps: Iterable[FlightStep]) -> None:
    """Add the steps of a new mission when the block ends."""
    tx.add(mission_steps, _step_rows(mission_id, steps, revision=1))


async def replace_planned(
    tx: Tx, mission_id: MissionId, steps: Iterable[FlightStep], *, revision: int
) -> None:
    """Add the steps of a revision; those it replaces, which never began, go."""
    await tx.execute(
        delete(mission_steps).where(
            mission_steps.c.mission_id == mission_id, mission_steps.c.status == "PLANNED"
        )
    )
    await _insert_steps(tx, mission_id, steps, revision=revision)


async def replace_steps(
    tx: Tx,
    mission_id: MissionId,
    steps: Iterable[FlightStep],
    *,
    first_step: int,
    revision: int,
) -> None:
    """Put these steps in the place of all from `first_step` on, also of one that was cut."""
    await tx.execute(
        delete(mission_steps).where(
            mission_steps.c.mission_id == mission_id, mission_steps.c.step_id >= first_step
        )
    )
    await _insert_steps(tx, mission_id, steps, revision=revision)


async def _insert_steps(
    tx: Tx, mission_id: MissionId, steps: Iterable[FlightStep], *, revision: int
) -> None:
    await tx.execute(_ADD_STEPS, _step_rows(mission_id, steps, revision=revision))


def _step_rows(
    mission_id: MissionId, steps: Iterable[FlightStep], *, revision: int
) -> list[dict[str, Any]]:  # column values of any type
    return [
        {
            "mission_id": mission_id,
            "step_id": step.step_id,
            "revision": revision,
            "status": "PLANNED",
            "step": step.model_dump_json(),
            **step_columns(step),
        }
        for step in steps
    ]


async def change_step(tx: Tx, mission_id: MissionId, step: FlightStep) -> None:
    """Keep a step as its drone flies it now; its number and revision stay."""
    await tx.execute(
        update(mission_steps)
        .where(mission_steps.c.mission_id == mission_id, mission_steps.c.step_id == step.step_id)
        .values(step=step.model_dump_json(), **step_columns(step))
    )


async def end_step(
    tx: Tx, mission_id: MissionId, event: DroneEvent, *, status: str
) -> FlightStep | None:
    """The step that an event ends, unless it has ended already, was never sent or replaced."""
    wanted = {
        "mission_id": mission_id,
        "step_id": event.step_id,
        "revision": event.mission_revision or _ANY_REVISION,
    }
    found = await tx.execute(_PLANNED_STEP, wanted)
    text = found.scalar_one_or_none()
    if text is None:
        return None
    ended = {
        "of_mission": mission_id,
        "of_step": event.step_id,
        "status": status,
        "started_ms": None if event.started_at is None else moment_to_ms(event.started_at),
        "ended_ms": moment_to_ms(event.ended_at),
        "event": event.model_dump_json(),
    }
    await tx.execute(_END_STEP, ended)
    return read_step(text)


async def steps_of(connection: AsyncConnection, mission_id: MissionId) -> list[StepRecord]:
    """All steps of a mission, in order."""
    found = await connection.execute(_STEPS, {"mission_id": mission_id})
    return [
        StepRecord(
            step=read_step(row.step),
            revision=row.revision,
            status=row.status,
            event=None if row.event is None else DroneEvent.read(row.event),
        )
        for row in found
    ]


async def held_packages(
    connection: AsyncConnection, delivery_id: DeliveryId
) -> dict[PackageId, Held]:
    """Who holds each package of a delivery now."""
    found = await connection.execute(_CHAIN, {"delivery_id": delivery_id})
    return {
        row.package_id: Held(
            row.package_id, row.seq, Custodian(row.custodian_kind, row.custodian_id)
        )
        for row in found
    }


def begin_custody(tx: Tx, record: MissionRecord, rows: Iterable[Held], *, at_ms: int) -> None:
    """Begin the chains of packages when the block ends."""
    tx.add(custody, _custody_rows(record, rows, at_ms=at_ms))


async def add_custody(tx: Tx, record: MissionRecord, rows: Iterable[Held], *, at_ms: int) -> None:
    """Pass packages on; a chain has each number once."""
    added = _custody_rows(record, rows, at_ms=at_ms)
    if added:
        await tx.execute(_ADD_CUSTODY, added)


def _custody_rows(
    record: MissionRecord, rows: Iterable[Held], *, at_ms: int
) -> list[dict[str, Any]]:  # column values of any type
    return [
        {
            "delivery_id": record.mission.delivery_id,
            "package_id": held.package_id,
            "seq": held.seq,
            "custodian_kind": held.custodian.kind,
            "custodian_id": held.custodian.custodian_id,
            "mission_id": record.mission_id,
            "at_ms": at_ms,
        }
        for held in rows
    ]


def _changing(record: MissionRecord) -> dict[str, Any]:  # column values of any type
    mission = record.mission
    return {
        "state": mission.state,
        "start_ms": moment_to_ms(mission.start_at),
        "released_ms": moment_to_ms(mission.released_at),
        "expires_ms": record.expires_ms,
        "body": _MISSIONS.write(mission),
        "report_seq": record.report_seq,
        "told": record.told,
        "stuck": None if record.stuck is None else record.stuck.model_dump_json(),
        "trouble": None if record.trouble is None else record.trouble.model_dump_json(),
        "proposal": None if record.proposal is None else record.proposal.model_dump_json(),
        "aims": _AIMS.dump_json(record.aims).decode(),
        "loading": mission.loading,
    }


def _record(row: Row[*tuple[Any, ...]]) -> MissionRecord:  # a row of missions
    return MissionRecord(
        mission=_MISSIONS.read(row.body),
        network_id=row.network_id,
        request=_REQUESTS.read(row.request),
        candidate=_CANDIDATES.read(row.candidate),
        expires_ms=row.expires_ms,
        report_seq=row.report_seq,
        told=row.told,
        stuck=None if row.stuck is None else Stuck.read(row.stuck),
        trouble=None if row.trouble is None else Trouble.read(row.trouble),
        proposal=None if row.proposal is None else Proposal.read(row.proposal),
        aims=_AIMS.validate_json(row.aims),
    )
