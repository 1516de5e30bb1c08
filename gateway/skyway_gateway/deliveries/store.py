"""The SQL by which deliveries, their packages, custody and missions change.

Any, for rows: their columns are of every type.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from sqlalchemy import BindParameter, Row, and_, bindparam, exists, insert, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.mission import MissionReport
from skyway.ids import DeliveryId, MissionId
from skyway.runtime.claims import FREE, NOW_MS, Claiming
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database, Tx
from skyway.runtime.errors import NotFound
from skyway.units import moment_to_ms
from skyway_gateway.deliveries import rows
from skyway_gateway.deliveries.delivery import Delivery, FlownMission, PackageStatus
from skyway_gateway.deliveries.rows import Queued
from skyway_gateway.deliveries.states import (
    SETTLED_PACKAGE_STATES,
    UNDER_WAY_STATES,
    may_follow,
)
from skyway_gateway.tables import custody, deliveries, missions, packages

#: As long as one booking may take, seconds of wall time. Two that book the same are answered the
#: same, so a claim that runs out costs a question, not a second drone.
_LEASE_S: Final = 25.0

# Statements of every delivery are made once: to make one takes as long as to run it.

_CLAIMING: Final = Claiming.of(
    deliveries,
    where=and_(deliveries.c.is_queued, deliveries.c.next_try_wall_ms <= NOW_MS),
    order_by=[deliveries.c.next_try_wall_ms, deliveries.c.delivery_id],
)
_THIS: Final = deliveries.c.delivery_id == bindparam("this")
_LOCKED: Final = select(deliveries).where(_THIS).with_for_update()
_SAVE: Final = update(deliveries).where(
    _THIS,
    deliveries.c.state == bindparam("state_before"),
    deliveries.c.attempt == bindparam("attempt_before"),
)
_IDS: Final[BindParameter[Sequence[str]]] = bindparam("ids", expanding=True)
_PACKAGES: Final = (
    select(packages).where(packages.c.delivery_id.in_(_IDS)).order_by(packages.c.number)
)
#: A refused mission was never flown, and is told in `refusals`.
_MISSIONS: Final = (
    select(missions.c.delivery_id, missions.c.body)
    .where(missions.c.delivery_id.in_(_IDS), missions.c.state != "REFUSED")
    .order_by(missions.c.attempt, missions.c.trip)
)
_SAVE_PACKAGE: Final = (
    update(packages)
    .where(
        packages.c.delivery_id == bindparam("this"),
        packages.c.package_id == bindparam("this_package"),
    )
    .values(custody_seq=packages.c.custody_seq + bindparam("moves"))
    .returning(packages.c.custody_seq)
)
_THIS_MISSION: Final = missions.c.mission_id == bindparam("this")
_SAVE_MISSION: Final = update(missions).where(_THIS_MISSION)
_REPORTED: Final = select(missions.c.mission_id, missions.c.report_seq).where(_THIS_MISSION)


@dataclass(frozen=True, slots=True)
class ReportedMission:
    """How far a mission's reports are applied."""

    mission_id: MissionId
    report_seq: int


async def add(tx: Tx, queued: Queued) -> None:
    """Keep a new delivery: from now on it is in the queue, and its packages are in custody."""
    delivery = queued.delivery
    await tx.execute(insert(deliveries), rows.new_delivery(queued))
    await tx.execute(insert(packages), rows.new_packages(delivery))
    first_links = [rows.custody_row(delivery, package, seq=1) for package in delivery.packages]
    await tx.execute(insert(custody), first_links)


async def claim_queued(
    db: Database, *, limit: int, claimant: str, clock: FleetClock
) -> Sequence[Queued]:
    """Deliveries whose booking is due, the longest waiting first, now held by us."""
    async with db.write() as tx:
        due = await _CLAIMING.run(tx, limit=limit, claimant=claimant, lease_s=_LEASE_S, clock=clock)
        found = await with_parts(tx.connection, due)
    return [rows.queued_of(row, delivery) for row, delivery in zip(due, found, strict=True)]


async def free_claims(tx: Tx) -> None:
    """Let go of all that somebody held: on SQLite whoever claimed before us is dead."""
    await tx.execute(update(deliveries).where(deliveries.c.is_queued).values(FREE))


async def try_later(
    tx: Tx,
    delivery_id: DeliveryId,
    *,
    next_try_at: datetime,
    reasons: Sequence[ProviderReason] | None,
) -> None:
    """Leave a delivery in the queue until a moment of wall time; None keeps the known reasons."""
    values: dict[str, object] = {"next_try_wall_ms": moment_to_ms(next_try_at), **FREE}
    if reasons is not None:
        values["reasons"] = rows.reasons_text(reasons)
    this = and_(deliveries.c.delivery_id == delivery_id, deliveries.c.is_queued)
    await tx.execute(update(deliveries).where(this).values(values))


async def keep_queued(tx: Tx, delivery_id: DeliveryId, *, until: datetime) -> None:
    """Have a delivery of which packages came back to the queue stay there until this moment."""
    values = {"give_up_ms": moment_to_ms(until)}
    this = and_(deliveries.c.delivery_id == delivery_id, deliveries.c.is_queued)
    await tx.execute(update(deliveries).where(this).values(values))


async def note_reasons(tx: Tx, delivery_id: DeliveryId, reasons: Sequence[ProviderReason]) -> None:
    """Keep why the packages that wait are about to be given up."""
    text = rows.reasons_text(reasons)
    this = and_(deliveries.c.delivery_id == delivery_id, deliveries.c.is_queued)
    await tx.execute(update(deliveries).where(this).values(reasons=text))


async def note_cancelling(tx: Tx, delivery_id: DeliveryId, *, reason: str) -> None:
    """Keep that all of a delivery that still can be stopped is to be."""
    this = deliveries.c.delivery_id == delivery_id
    await tx.execute(update(deliveries).where(this).values(cancel_reason=reason))


async def lock(tx: Tx, delivery_id: DeliveryId) -> Delivery:
    """A delivery that nobody else changes until this transaction ends.

    Raises
    ------
    NotFound
        There is no such delivery.
    """
    found = (await tx.execute(_LOCKED, {"this": delivery_id})).all()
    if not found:
        raise NotFound("delivery", delivery_id)
    [delivery] = await with_parts(tx.connection, found)
    return delivery


async def save(tx: Tx, before: Delivery, after: Delivery) -> None:
    """Write what changed of a locked delivery."""
    if not may_follow(after.state, before.state):
        raise RuntimeError(f"a delivery never goes from {before.state} to {after.state}")
    this = {
        "this": before.delivery_id,
        "state_before": before.state,
        "attempt_before": before.attempt,
    }
    values = rows.changing(after)
    if (before.attempt, before.is_queued) != (after.attempt, after.is_queued):
        # What is to be booked is another thing now, to be looked at at once.
        values |= {"next_try_wall_ms": 0, **FREE}
    if (await tx.execute(_SAVE, {**this, **values})).rowcount != 1:
        raise RuntimeError(f"delivery {before.delivery_id} was not locked when it was changed")
    for package, changed in zip(before.packages, after.packages, strict=True):
        if changed != package:
            await _save_package(
                tx, after, changed, has_moved=changed.custodian != package.custodian
            )
    await _save_missions(tx, before.missions, after.missions)


async def _save_missions(
    tx: Tx, before: Sequence[FlownMission], after: Sequence[FlownMission]
) -> None:
    known = {mission.mission_id: mission for mission in before}
    for mission in after:
        if mission.mission_id not in known:
            await tx.execute(insert(missions), rows.mission_row(mission))
        elif mission != known[mission.mission_id]:
            values = {"this": mission.mission_id, **rows.mission_values(mission)}
            await tx.execute(_SAVE_MISSION, values)


async def reported_mission(tx: Tx, mission_id: MissionId) -> ReportedMission | None:
    """How far a mission's reports are applied; None for a mission that is not known yet."""
    row = (await tx.execute(_REPORTED, {"this": mission_id})).one_or_none()
    return None if row is None else ReportedMission(row.mission_id, row.report_seq)


async def note_report(tx: Tx, report: MissionReport) -> None:
    """Note that a mission's reports are applied up to this one."""
    await tx.execute(_SAVE_MISSION, {"this": report.mission_id, **rows.reported(report)})


async def overdue(
    connection: AsyncConnection, *, before: datetime, limit: int
) -> Sequence[DeliveryId]:
    """Deliveries not known to be late, of which a package should have come before this moment."""
    is_overdue = exists().where(
        packages.c.delivery_id == deliveries.c.delivery_id,
        packages.c.eta_ms < moment_to_ms(before),
        packages.c.state.not_in(SETTLED_PACKAGE_STATES),
    )
    statement = select(deliveries.c.delivery_id).where(
        deliveries.c.state.in_(UNDER_WAY_STATES), ~deliveries.c.is_delayed, is_overdue
    )
    found = await connection.execute(statement.order_by(deliveries.c.delivery_id).limit(limit))
    return [DeliveryId(delivery_id) for delivery_id in found.scalars()]


async def with_parts(
    connection: AsyncConnection, found: Sequence[Row[*tuple[Any, ...]]]
) -> Sequence[Delivery]:
    """The deliveries of these rows, with their packages and missions, in the same order."""
    ids = [row.delivery_id for row in found]
    if not ids:
        return []
    packed: dict[str, list[PackageStatus]] = defaultdict(list)
    for row in await connection.execute(_PACKAGES, {"ids": ids}):
        packed[row.delivery_id].append(rows.package_of(row))
    flown: dict[str, list[FlownMission]] = defaultdict(list)
    for row in await connection.execute(_MISSIONS, {"ids": ids}):
        flown[row.delivery_id].append(FlownMission.read(row.body))
    return [rows.delivery_of(row, packed[row.delivery_id], flown[row.delivery_id]) for row in found]


async def _save_package(
    tx: Tx, delivery: Delivery, package: PackageStatus, *, has_moved: bool
) -> None:
    values = {
        "this": delivery.delivery_id,
        "this_package": package.package_id,
        "moves": int(has_moved),
        **rows.package_values(package),
    }
    seq: int = (await tx.execute(_SAVE_PACKAGE, values)).scalar_one()
    if has_moved:
        await tx.execute(insert(custody), rows.custody_row(delivery, package, seq=seq))
