"""All SQL of learned values: what the flights of each drone have shown about it.

The health is that of its battery. It is stored with the battery, if the provider has registered it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import timedelta
from typing import Final

from sqlalchemy import BigInteger, Join, and_, bindparam, delete, or_, select, update
from sqlalchemy.sql.selectable import FromClause

from skyway.contracts.drone_report import DroneState
from skyway.ids import DroneId, MissionId
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway.units import moment_to_ms, ms_to_moment
from skyway_provider_registry.presence.learning import (
    Learned,
    LearnedDrone,
    learned_from,
    why_maintenance,
)
from skyway_provider_registry.presence.sighting_store import ReceptionTime
from skyway_provider_registry.tables import batteries, drones, learned_values, mission_hints

#: The least fleet time between two observations of a drone that count, by the registry's clock.
#: A flight to the next station takes longer, but a drone could report a landing each second
#: without any flight. Our own choice, as is the next number.
_APART: Final = timedelta(seconds=60)

#: The last landing of a mission may come after composition's report of its end: so much later.
_ENDED_BEFORE: Final = timedelta(seconds=30)

#: The health of a battery that is not registered, before the first flight with it.
_UNKNOWN_BATTERY: Final = {"state_of_health": 1.0, "health_observations": 0}

#: The columns that say what was learned; for a query over `with_learned`.
LEARNED_COLUMNS: Final = (
    *(
        learned_values.c[name]
        for name in (
            "flights",
            "recharges",
            "still_air_factor",
            "still_air_variance",
            "state_of_health",
            "charge_rate_factor",
            "health_observations",
            "is_maintenance_due",
            "since_ms",
        )
    ),
    batteries.c.battery_id,
    batteries.c.state_of_health.label("battery_health"),
    batteries.c.health_observations.label("battery_observations"),
    batteries.c.installed_ms.label("battery_installed_ms"),
)


def with_learned(fleet: FromClause) -> Join:
    """Drones, with what was learned about each and about its battery."""
    return fleet.outerjoin(
        learned_values, learned_values.c.drone_id == drones.c.drone_id
    ).outerjoin(batteries, batteries.c.drone_id == drones.c.drone_id)


_LEARNED: Final = (
    select(
        drones.c.drone_id,
        *LEARNED_COLUMNS,
        learned_values.c.learned_session,
        learned_values.c.learned_seq,
        learned_values.c.learned_ms,
    )
    .select_from(with_learned(drones))
    .where(in_list(drones.c.drone_id, "drone_ids"))
)
_has_just_ended = and_(
    mission_hints.c.mission_state == "COMPLETED",
    mission_hints.c.reported_wall_ms >= bindparam("ended_wall_ms", type_=BigInteger),
)
_UNDER_WAY: Final = select(mission_hints.c.drone_id, mission_hints.c.mission_id).where(
    in_list(mission_hints.c.mission_id, "mission_ids"),
    or_(mission_hints.c.is_live, _has_just_ended),
)


@dataclass(frozen=True, slots=True)
class EndedStep:
    """The state in which a drone has ended a flight or a recharge, and what it did before."""

    before: str
    mission_id: MissionId | None
    state: DroneState


async def learn(
    tx: Tx, ended: Mapping[DroneId, EndedStep], *, received_at: ReceptionTime
) -> dict[DroneId, str]:
    """Learn from these states; returns the reason for each drone that now needs maintenance.

    Each state counts once, however often and by whichever replica it is read.

    The rows of `presence` are locked, and so are these. Only missions of composition that are under
    way count, and at most one state in `_APART`: a drone without a mission teaches nothing, and one
    that only pretends to fly its mission is not faster than one that flies.
    """
    worse: dict[DroneId, str] = {}
    if not ended:
        return worse
    now_ms = moment_to_ms(received_at.fleet_at)
    known = await tx.execute(_LEARNED, {"drone_ids": sorted(ended)})
    rows = {row.drone_id: row for row in known}
    missions = sorted({step.mission_id for step in ended.values() if step.mission_id is not None})
    since_ms = moment_to_ms(received_at.wall_at - _ENDED_BEFORE)
    asked = {"mission_ids": missions, "ended_wall_ms": since_ms}
    under_way = {tuple(row) for row in await tx.execute(_UNDER_WAY, asked)}
    for drone_id, step in sorted(ended.items()):
        state, row = step.state, rows.get(drone_id)
        if row is None or _is_too_early(row, state, received_at):
            continue
        before = learned_of(row)
        after = learned_from(before, before=step.before, state=state)
        if after == before or (drone_id, step.mission_id) not in under_way:
            continue
        await _store(tx, drone_id, row, after, state=state, now_ms=now_ms)
        reason = why_maintenance(before, after)
        if reason is not None:
            worse[drone_id] = reason
    return worse


def _is_too_early(row: AnyRow, state: DroneState, received_at: ReceptionTime) -> bool:
    """Whether this state was learned from, or follows too soon after the last such state."""
    if row.flights is None:
        return False
    is_old = (row.learned_session, row.learned_seq) >= (state.session, state.seq)
    return is_old or ms_to_moment(row.learned_ms) + _APART > received_at.fleet_at


async def _store(
    tx: Tx, drone_id: DroneId, row: AnyRow, after: Learned, *, state: DroneState, now_ms: int
) -> None:
    """Store what is known after a state; `row` is from before it."""
    health = {
        "state_of_health": after.state_of_health,
        "health_observations": after.health_observations,
    }
    values = {
        "flights": after.flights,
        "recharges": after.recharges,
        "still_air_factor": after.still_air_factor,
        "still_air_variance": after.still_air_variance,
        "charge_rate_factor": after.charge_rate_factor,
        "is_maintenance_due": after.is_maintenance_due,
        "learned_session": state.session,
        "learned_seq": state.seq,
        "learned_ms": now_ms,
    }
    if row.battery_id is None:
        values |= health
    else:
        this = batteries.c.battery_id == row.battery_id
        await tx.execute(update(batteries).where(this).values(health))
    first = _UNKNOWN_BATTERY | values
    new = tx.insert(learned_values).values(drone_id=drone_id, since_ms=now_ms, **first)
    await tx.execute(new.on_conflict_do_update(index_elements=["drone_id"], set_=values))


async def forget_health(tx: Tx, drone_id: DroneId) -> None:
    """Forget the health that was learned with a battery that is not registered."""
    this = learned_values.c.drone_id == drone_id
    await tx.execute(update(learned_values).where(this).values(_UNKNOWN_BATTERY))


async def forget(tx: Tx, drone_id: DroneId) -> None:
    """Forget what was learned about a drone: it counts as its model says.

    A registered battery keeps what was learned about it.
    """
    await tx.execute(delete(learned_values).where(learned_values.c.drone_id == drone_id))


def learned_of(row: AnyRow) -> Learned:
    """The values in a row with `LEARNED_COLUMNS`; the model's if nothing was learned."""
    learned = Learned()
    if row.flights is not None:
        learned = Learned(
            flights=row.flights,
            recharges=row.recharges,
            still_air_factor=row.still_air_factor,
            still_air_variance=row.still_air_variance,
            state_of_health=row.state_of_health,
            charge_rate_factor=row.charge_rate_factor,
            is_maintenance_due=row.is_maintenance_due,
            health_observations=row.health_observations,
        )
    if row.battery_id is None:
        return learned
    return replace(
        learned,
        state_of_health=row.battery_health,
        health_observations=row.battery_observations,
    )


def shown(row: AnyRow) -> LearnedDrone | None:
    """The values in a row with `LEARNED_COLUMNS` as they are shown; None if nothing was learned."""
    if row.flights is None and row.battery_id is None:
        return None
    learned = learned_of(row)
    since_ms = row.battery_installed_ms if row.flights is None else row.since_ms
    return LearnedDrone(
        still_air_factor=round(learned.still_air_factor, 3),
        state_of_health=round(learned.state_of_health, 3),
        charge_rate_factor=round(learned.charge_rate_factor, 3),
        flights=learned.flights,
        recharges=learned.recharges,
        since_at=ms_to_moment(since_ms),
        planned=learned.planned,
    )
