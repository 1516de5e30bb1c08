"""All SQL of maintenance: the rules of providers, and the drones that are due."""

from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Final

from sqlalchemy import ColumnElement, and_, delete, exists, or_, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DroneId, DroneModelId, ProviderId
from skyway.runtime.errors import NotFound
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway.units import moment_to_ms, ms_to_moment
from skyway_provider_registry.change_store import next_change
from skyway_provider_registry.presence.jump_store import keep_waiting
from skyway_provider_registry.presence.store import touch
from skyway_provider_registry.presence.wear import (
    DroneMaintenance,
    MaintenanceRule,
    ModelMaintenance,
    Wear,
    maintenance_alarm,
)
from skyway_provider_registry.tables import drones, maintenance_rules, presence

#: What a drone has flown and used since its last maintenance.
_flown_s = presence.c.flown_s - drones.c.maintained_flown_s
_used_soc = presence.c.used_soc - drones.c.maintained_used_soc

_is_of_rule = and_(
    maintenance_rules.c.provider_id == drones.c.provider_id,
    maintenance_rules.c.model_id == drones.c.model_id,
)
_is_over_limit = or_(
    _flown_s >= maintenance_rules.c.every_flight_s, _used_soc >= maintenance_rules.c.every_cycles
)
#: Whether a drone is over a limit of its rule; False without a rule.
IS_OVER_LIMIT: Final = exists().where(
    presence.c.drone_id == drones.c.drone_id, _is_of_rule, _is_over_limit
)
_NEWLY_DUE: Final = (
    select(
        drones.c.drone_id,
        drones.c.provider_id,
        maintenance_rules.c.every_flight_s,
        maintenance_rules.c.every_cycles,
        presence.c.flown_s,
        presence.c.used_soc,
        drones.c.maintained_flown_s,
        drones.c.maintained_used_soc,
    )
    .join_from(drones, presence, presence.c.drone_id == drones.c.drone_id)
    .join(maintenance_rules, _is_of_rule)
    .where(drones.c.maintenance_due_ms.is_(None), _is_over_limit)
    .order_by(drones.c.drone_id)
)
_NEWLY_DUE_OF: Final = _NEWLY_DUE.where(in_list(drones.c.drone_id, "drone_ids"))


def maintenance_of(row: AnyRow) -> DroneMaintenance:
    """The maintenance of a drone, from a row of the drone and its presence."""
    return DroneMaintenance.of(
        _wear_of(row),
        maintained_at=_moment(row.maintained_ms),
        due_since_at=_moment(row.maintenance_due_ms),
    )


async def mark_due(tx: Tx, drone_ids: Collection[DroneId], *, at: datetime) -> dict[DroneId, str]:
    """Mark the drones among these that have become due; returns the reason for each."""
    if not drone_ids:
        return {}
    found = await tx.execute(_NEWLY_DUE_OF, {"drone_ids": sorted(drone_ids)})
    return await _mark(tx, found.all(), at=at)


async def record_maintenance(tx: Tx, drone_id: DroneId, *, at: datetime) -> None:
    """Begin the counters of a drone at 0 again: its maintenance was done."""
    await touch(tx, drone_id)
    await _end_alarms(tx, drones.c.drone_id == drone_id, at=at)
    counters = select(presence.c.flown_s, presence.c.used_soc)
    row = (await tx.execute(counters.where(presence.c.drone_id == drone_id))).one()
    statement = update(drones).where(drones.c.drone_id == drone_id)
    await tx.execute(
        statement.values(
            maintained_flown_s=row.flown_s,
            maintained_used_soc=row.used_soc,
            maintained_ms=moment_to_ms(at),
            maintenance_due_ms=None,
        )
    )


async def rules_of(
    connection: AsyncConnection, provider_id: ProviderId
) -> Sequence[ModelMaintenance]:
    """The rules of a provider, by model."""
    query = (
        select(maintenance_rules)
        .where(maintenance_rules.c.provider_id == provider_id)
        .order_by(maintenance_rules.c.model_id)
    )
    return [
        ModelMaintenance(model_id=row.model_id, **_rule_of(row).model_dump())
        for row in await connection.execute(query)
    ]


async def put_rule(
    tx: Tx,
    provider_id: ProviderId,
    model_id: DroneModelId,
    rule: MaintenanceRule,
    *,
    at: datetime,
) -> None:
    """Store the rule for a model; drones that are over its limits are due from now on."""
    change = await next_change(tx)
    limits = {"every_flight_s": rule.every_flight_s, "every_cycles": rule.every_cycles}
    new = tx.insert(maintenance_rules).values(provider_id=provider_id, model_id=model_id, **limits)
    await tx.execute(
        new.on_conflict_do_update(index_elements=["provider_id", "model_id"], set_=limits)
    )
    await _judge_again(tx, provider_id, model_id, change=change, at=at)


async def remove_rule(
    tx: Tx, provider_id: ProviderId, model_id: DroneModelId, *, at: datetime
) -> None:
    """Remove the rule for a model; its drones are not due any more.

    Raises
    ------
    NotFound
        The provider has no rule for this model.
    """
    change = await next_change(tx)
    this = and_(
        maintenance_rules.c.provider_id == provider_id, maintenance_rules.c.model_id == model_id
    )
    if (await tx.execute(delete(maintenance_rules).where(this))).rowcount == 0:
        raise NotFound("maintenance rule", model_id)
    await _judge_again(tx, provider_id, model_id, change=change, at=at)


async def _judge_again(
    tx: Tx, provider_id: ProviderId, model_id: DroneModelId, *, change: int, at: datetime
) -> None:
    """Compare the drones of a model with their new rule; drones that become due get an alarm."""
    these = and_(drones.c.provider_id == provider_id, drones.c.model_id == model_id)
    await _end_alarms(tx, and_(these, ~IS_OVER_LIMIT), at=at)
    found = (await tx.execute(_NEWLY_DUE.where(these))).all()
    for drone_id, reason in (await _mark(tx, found, at=at)).items():
        await keep_waiting(tx, maintenance_alarm(provider_id, drone_id, reason, at=at))
    await tx.execute(update(presence).where(_is_among(these)).values(changed=change))


async def _end_alarms(tx: Tx, which: ColumnElement[bool], *, at: datetime) -> None:
    """Drones that are due among these are so no more, and neither are their alarms."""
    no_longer = update(drones).where(which, drones.c.maintenance_due_ms.is_not(None))
    ended = no_longer.values(maintenance_due_ms=None).returning(
        drones.c.provider_id, drones.c.drone_id
    )
    for provider_id, drone_id in (await tx.execute(ended)).all():
        reason = "the drone is not due for maintenance any more"
        over = maintenance_alarm(provider_id, drone_id, reason, at=at, is_over=True)
        await keep_waiting(tx, over)


async def _mark(tx: Tx, rows: Sequence[AnyRow], *, at: datetime) -> dict[DroneId, str]:
    reasons = {}
    for row in rows:
        reason = _rule_of(row).why_due(_wear_of(row))
        # The database has compared the same numbers.
        reasons[DroneId(row.drone_id)] = reason or "it is over a limit of its maintenance rule"
    if reasons:
        marked = update(drones).where(in_list(drones.c.drone_id, "drone_ids"))
        due = marked.values(maintenance_due_ms=moment_to_ms(at))
        await tx.execute(due, {"drone_ids": sorted(reasons)})
    return reasons


def _wear_of(row: AnyRow) -> Wear:
    """What the drone of a row has flown and used since its last maintenance."""
    return Wear(row.flown_s - row.maintained_flown_s, row.used_soc - row.maintained_used_soc)


def _rule_of(row: AnyRow) -> MaintenanceRule:
    hours = None if row.every_flight_s is None else round(row.every_flight_s / 3_600, 6)
    return MaintenanceRule.model_construct(every_flight_hours=hours, every_cycles=row.every_cycles)


def _is_among(these: ColumnElement[bool]) -> ColumnElement[bool]:
    return presence.c.drone_id.in_(select(drones.c.drone_id).where(these))


def _moment(moment_ms: int | None) -> datetime | None:
    return None if moment_ms is None else ms_to_moment(moment_ms)
