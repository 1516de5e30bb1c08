"""All SQL of learned values: what the flights of each drone have shown about it."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from sqlalchemy import Text, bindparam, delete, exists, select

from skyway.contracts.drone_report import DroneState
from skyway.ids import DroneId, MissionId
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_provider_registry.presence.learning import (
    Learned,
    LearnedDrone,
    learned_from,
    why_maintenance,
)
from skyway_provider_registry.tables import learned_values, mission_hints

#: The columns that say what was learned; a query over drones joins them.
LEARNED_COLUMNS: Final = tuple(
    learned_values.c[name]
    for name in (
        "flights",
        "recharges",
        "still_air_factor",
        "state_of_health",
        "charge_rate_factor",
        "since_ms",
    )
)

_LEARNED: Final = select(learned_values).where(
    learned_values.c.drone_id == bindparam("about", type_=Text)
)
_IS_BOOKED: Final = select(
    exists().where(
        mission_hints.c.mission_id == bindparam("mission", type_=Text),
        mission_hints.c.drone_id == bindparam("about", type_=Text),
    )
)


@dataclass(frozen=True, slots=True)
class EndedStep:
    """The state in which a drone has ended a flight or a recharge, and what it did before."""

    before: str
    mission_id: MissionId | None
    state: DroneState


async def learn(tx: Tx, ended: Mapping[DroneId, EndedStep], *, now: datetime) -> dict[DroneId, str]:
    """Learn from these states; returns the reason for each drone that now needs maintenance.

    Each state counts once, however often and by whichever replica it is read.

    The rows of `presence` are locked, and so are these. Only missions of composition count: a drone
    that pretends to fly gains nothing.
    """
    worse: dict[DroneId, str] = {}
    for drone_id, step in sorted(ended.items()):
        state, about = step.state, {"about": drone_id}
        row = (await tx.execute(_LEARNED, about)).one_or_none()
        if row and (row.learned_session, row.learned_seq) >= (state.session, state.seq):
            continue
        before = Learned() if row is None else learned_of(row)
        after = learned_from(before, before=step.before, state=state)
        booked = await tx.execute(_IS_BOOKED, about | {"mission": step.mission_id})
        if after == before or not booked.scalar_one():
            continue
        values = {
            "flights": after.flights,
            "recharges": after.recharges,
            "still_air_factor": after.still_air_factor,
            "state_of_health": after.state_of_health,
            "charge_rate_factor": after.charge_rate_factor,
            "learned_session": state.session,
            "learned_seq": state.seq,
        }
        new = tx.insert(learned_values).values(
            drone_id=drone_id, since_ms=moment_to_ms(now), **values
        )
        await tx.execute(new.on_conflict_do_update(index_elements=["drone_id"], set_=values))
        reason = why_maintenance(before, after)
        if reason is not None:
            worse[drone_id] = reason
    return worse


async def forget(tx: Tx, drone_id: DroneId) -> None:
    """Forget what was learned about a drone: it counts as its model says."""
    await tx.execute(delete(learned_values).where(learned_values.c.drone_id == drone_id))


def learned_of(row: AnyRow) -> Learned:
    """The values in a row with `LEARNED_COLUMNS`; the model's if nothing was learned."""
    if row.flights is None:
        return Learned()
    return Learned(
        flights=row.flights,
        recharges=row.recharges,
        still_air_factor=row.still_air_factor,
        state_of_health=row.state_of_health,
        charge_rate_factor=row.charge_rate_factor,
    )


def shown(row: AnyRow) -> LearnedDrone | None:
    """The values in a row with `LEARNED_COLUMNS` as they are shown; None if nothing was learned."""
    if row.flights is None:
        return None
    learned = learned_of(row)
    return LearnedDrone(
        still_air_factor=round(learned.still_air_factor, 3),
        state_of_health=round(learned.state_of_health, 3),
        charge_rate_factor=round(learned.charge_rate_factor, 3),
        flights=learned.flights,
        recharges=learned.recharges,
        since_at=ms_to_moment(row.since_ms),
        planned=learned.planned,
    )
