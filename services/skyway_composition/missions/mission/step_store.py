"""The steps of a mission, with all SQL: as they were sent, how they ended, and which were cut."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Any, Final, Literal

from pydantic import TypeAdapter
from sqlalchemy import Row, bindparam, delete, func, insert, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import FlightStep
from skyway.ids import MissionId
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway.units import moment_to_ms
from skyway_composition.tables import cut_steps, mission_steps, missions

#: An event without a revision matches a step of any revision.
_ANY_REVISION: Final = 2**31 - 1

#: How many steps and how many events are cached, about 3 KiB each.
_MOST_TEXTS: Final = 8_192

# Every booking and every message of a drone needs these statements. Building them takes longer
# than running them, so they are built once.
_ADD_STEPS: Final = insert(mission_steps)

_END_STEP: Final = update(mission_steps).where(
    mission_steps.c.mission_id == bindparam("of_mission"),
    mission_steps.c.step_id == bindparam("of_step"),
)

_STEPS: Final = (
    select(
        mission_steps.c.mission_id,
        mission_steps.c.step,
        mission_steps.c.revision,
        mission_steps.c.status,
        mission_steps.c.event,
    )
    .where(in_list(mission_steps.c.mission_id, "mission_ids"))
    .order_by(mission_steps.c.mission_id, mission_steps.c.step_id)
)


_CUT_EVENTS: Final = select(cut_steps.c.event).where(
    cut_steps.c.mission_id == bindparam("mission_id")
)


@dataclass(frozen=True, slots=True)
class StepRecord:
    """A step as it was sent, and the event that ended it."""

    step: FlightStep
    revision: int
    status: Literal["PLANNED", "ENDED", "FAILED"]
    event: DroneEvent | None


# The steps of a mission and their events are read again with each event of its drone.
@lru_cache(_MOST_TEXTS)
def read_step(text: str) -> FlightStep:
    """The step in this JSON; all readers of a text share its frozen value."""
    return _adapter().validate_json(text, extra="ignore")


_read_event: Final = lru_cache(_MOST_TEXTS)(DroneEvent.read)


@cache
def _adapter() -> TypeAdapter[FlightStep]:
    return TypeAdapter(FlightStep)


def flown_totals(events: Sequence[DroneEvent]) -> dict[str, float]:
    """The seconds and joules that ended steps took; `events` are in the order of their ends.

    Time between two steps counts as waiting: a drone that arrives early at its pad waits there.
    """
    totals = dict.fromkeys(("flight_s", "recharging_s", "waiting_s", "energy_j"), 0.0)
    previous_end = None
    for event in events:
        if event.started_at is None:
            continue
        if previous_end is not None:
            totals["waiting_s"] += max(0.0, (event.started_at - previous_end).total_seconds())
        previous_end = event.ended_at
        name = {"FLY": "flight_s", "RECHARGE": "recharging_s", "WAIT": "waiting_s"}.get(
            event.step_kind or ""
        )
        if name is not None:
            totals[name] += (event.ended_at - event.started_at).total_seconds()
        totals["energy_j"] += event.energy_j
    return totals


def add_steps(tx: Tx, mission_id: MissionId, steps: Iterable[FlightStep]) -> None:
    """Add the steps of a new mission when the transaction ends."""
    tx.add(mission_steps, _step_rows(mission_id, steps, revision=1))


async def replace_steps(
    tx: Tx,
    mission_id: MissionId,
    steps: Iterable[FlightStep],
    *,
    first_step: int,
    revision: int,
) -> None:
    """Replace all steps from `first_step` on, a cut step included."""
    await tx.execute(
        delete(mission_steps).where(
            mission_steps.c.mission_id == mission_id, mission_steps.c.step_id >= first_step
        )
    )
    await _insert_steps(tx, mission_id, steps, revision=revision)


async def steps_of(connection: AsyncConnection, mission_id: MissionId) -> list[StepRecord]:
    """All steps of a mission, in order."""
    return (await _steps_of_all(connection, [mission_id]))[mission_id]


async def _steps_of_all(
    connection: AsyncConnection, mission_ids: Collection[MissionId]
) -> dict[MissionId, list[StepRecord]]:
    steps: dict[MissionId, list[StepRecord]] = {each: [] for each in mission_ids}
    for row in await connection.execute(_STEPS, {"mission_ids": [*mission_ids]}):
        steps[row.mission_id].append(step_record(row))
    return steps


class LiveSteps:
    """The steps of live missions in the transaction that has locked them.

    The steps of all these missions are read together, once. They change only through this object.
    """

    def __init__(self, tx: Tx, mission_ids: Collection[MissionId]) -> None:
        self._tx = tx
        self._mission_ids = frozenset(mission_ids)
        self._read: dict[MissionId, list[StepRecord]] = {}
        self._changed: set[MissionId] = set()

    async def of(self, mission_id: MissionId) -> list[StepRecord]:
        """All steps of a mission, in order; those of a mission that is not live are read anew."""
        if mission_id not in self._mission_ids:
            return await steps_of(self._tx.connection, mission_id)
        if mission_id not in self._read:
            unread = sorted(self._mission_ids - self._read.keys())
            self._read |= await _steps_of_all(self._tx.connection, unread)
        return self._read[mission_id]

    async def planned(self, mission_id: MissionId, event: DroneEvent) -> FlightStep | None:
        """The step that this event ends.

        None if the step has ended before, was replaced, or was never sent.
        """
        # A cut step and the step that replaced it have the same number; the replacement is newer.
        revision = event.mission_revision or _ANY_REVISION
        for each in await self.of(mission_id):
            if each.step.step_id == event.step_id:
                is_planned = each.status == "PLANNED" and each.revision <= revision
                return each.step if is_planned else None
        return None

    async def end(
        self, mission_id: MissionId, event: DroneEvent, *, status: Literal["ENDED", "FAILED"]
    ) -> None:
        """Mark the step that this event ends."""
        ended = {
            "of_mission": mission_id,
            "of_step": event.step_id,
            "status": status,
            "started_ms": None if event.started_at is None else moment_to_ms(event.started_at),
            "ended_ms": moment_to_ms(event.ended_at),
            "event": event.model_dump_json(),
        }
        await self._tx.execute(_END_STEP, ended)
        self._changed.add(mission_id)
        self._read[mission_id] = [
            replace(each, status=status, event=event)
            if each.step.step_id == event.step_id
            else each
            for each in await self.of(mission_id)
        ]

    async def replace(
        self,
        mission_id: MissionId,
        steps: Iterable[FlightStep],
        *,
        first_step: int,
        revision: int,
    ) -> None:
        """Replace all steps from `first_step` on, a cut step included."""
        await replace_steps(self._tx, mission_id, steps, first_step=first_step, revision=revision)
        self._forget(mission_id)

    async def replace_planned(
        self, mission_id: MissionId, steps: Iterable[FlightStep], *, revision: int
    ) -> None:
        """Replace all planned steps with the steps of a revision."""
        await self._tx.execute(
            delete(mission_steps).where(
                mission_steps.c.mission_id == mission_id, mission_steps.c.status == "PLANNED"
            )
        )
        await _insert_steps(self._tx, mission_id, steps, revision=revision)
        self._forget(mission_id)

    async def change(self, mission_id: MissionId, step: FlightStep) -> None:
        """Save a changed step; its number and revision stay."""
        await self._tx.execute(
            update(mission_steps)
            .where(
                mission_steps.c.mission_id == mission_id, mission_steps.c.step_id == step.step_id
            )
            .values(step=step.model_dump_json(), **_step_columns(step))
        )
        self._forget(mission_id)

    def _forget(self, mission_id: MissionId) -> None:
        self._changed.add(mission_id)
        self._read.pop(mission_id, None)

    async def next_ends_ms(self) -> dict[MissionId, int | None]:
        """When the next step of each mission whose steps were changed ends; None without one."""
        steps = {each: await self.of(each) for each in self._changed}
        ends_at = {
            mission_id: [each.step.planned_end_at for each in own if each.status == "PLANNED"]
            for mission_id, own in steps.items()
        }
        return {each: moment_to_ms(min(at)) if at else None for each, at in ends_at.items()}

    async def ended_events(self, mission_id: MissionId) -> list[DroneEvent]:
        """The end events of all steps of a mission, cut steps included, in order."""
        return await ended_events(self._tx.connection, mission_id, await self.of(mission_id))


async def next_steps_of(
    connection: AsyncConnection, mission_ids: Collection[MissionId]
) -> dict[MissionId, FlightStep]:
    """The first step of each of these missions that has not ended; nothing for other missions."""
    first = (
        select(mission_steps.c.mission_id, func.min(mission_steps.c.step_id).label("step_id"))
        .where(mission_steps.c.mission_id.in_(sorted(mission_ids)))
        .where(mission_steps.c.status == "PLANNED")
        .group_by(mission_steps.c.mission_id)
        .subquery()
    )
    is_first = (mission_steps.c.mission_id == first.c.mission_id) & (
        mission_steps.c.step_id == first.c.step_id
    )
    found = await connection.execute(
        select(mission_steps.c.mission_id, mission_steps.c.step).join(first, is_first)
    )
    return {row.mission_id: read_step(row.step) for row in found}


def step_record(row: Row[*tuple[Any, ...]]) -> StepRecord:
    """The step in a row of `mission_steps`; Any: columns of different types."""
    return StepRecord(
        step=read_step(row.step),
        revision=row.revision,
        status=row.status,
        event=None if row.event is None else _read_event(row.event),
    )


async def keep_cut_step(tx: Tx, mission_id: MissionId, event: DroneEvent) -> None:
    """Save the end of a cut step, before the step that replaces it overwrites it."""
    if event.started_at is None:
        return
    row = {
        "mission_id": mission_id,
        "seq": event.seq,
        "step_id": event.step_id,
        "kind": event.step_kind,
        "station_id": event.station_id,
        "started_ms": moment_to_ms(event.started_at),
        "ended_ms": moment_to_ms(event.ended_at),
        "event": event.model_dump_json(),
    }
    added = await tx.execute(tx.insert(cut_steps).values(row).on_conflict_do_nothing())
    counted = update(missions).where(missions.c.mission_id == mission_id)
    await tx.execute(counted.values(cuts=missions.c.cuts + added.rowcount))


async def ended_events(
    connection: AsyncConnection, mission_id: MissionId, steps: Iterable[StepRecord]
) -> list[DroneEvent]:
    """The end events of a mission with these steps, cut steps included, in order."""
    found = await connection.execute(_CUT_EVENTS, {"mission_id": mission_id})
    ended = (each.event for each in steps if each.status == "ENDED" and each.event is not None)
    # A cut step is in both tables until another step gets its number.
    events = {event.seq: event for event in (*ended, *map(_read_event, found.scalars()))}
    return [events[seq] for seq in sorted(events)]


async def _insert_steps(
    tx: Tx, mission_id: MissionId, steps: Iterable[FlightStep], *, revision: int
) -> None:
    rows = _step_rows(mission_id, steps, revision=revision)
    if rows:
        await tx.execute(_ADD_STEPS, rows)


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
            **_step_columns(step),
        }
        for step in steps
    ]


def _step_columns(step: FlightStep) -> dict[str, Any]:  # column values of any type
    """The columns of `mission_steps` that say what a step does, where and when."""
    return {
        "kind": step.kind,
        "station_id": None if step.kind == "FLY" else step.station_id,
        "pad": step.pad if step.kind == "RECHARGE" else None,
        "planned_start_ms": moment_to_ms(step.planned_start_at),
        "planned_end_ms": moment_to_ms(step.planned_end_at),
        "from_station_id": step.from_id if step.kind == "FLY" else None,
        "to_station_id": step.to_id if step.kind == "FLY" else None,
        "lands": step.lands if step.kind == "FLY" else None,
    }
