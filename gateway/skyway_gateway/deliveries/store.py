"""The SQL by which deliveries, their packages, custody and missions change (queue: `queueing`).

Any, for rows: their columns are of every type.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from datetime import datetime
from functools import cache
from typing import Any, Final

from sqlalchemy import (
    BigInteger,
    FromClause,
    Integer,
    Row,
    Select,
    Text,
    and_,
    bindparam,
    exists,
    or_,
    select,
    update,
)
from sqlalchemy.ext.asyncio import AsyncConnection
from sqlalchemy.sql.dml import ReturningUpdate

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.mission import MissionReport
from skyway.ids import DeliveryId, MissionId
from skyway.runtime.errors import NotFound
from skyway.runtime.sql.among import among
from skyway.runtime.sql.claims import FREE
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.declared import Consequence
from skyway.units import moment_to_ms
from skyway_gateway.deliveries import rows
from skyway_gateway.deliveries.delivery import Delivery, FlownMission, PackageStatus
from skyway_gateway.deliveries.known import Known, Outdated
from skyway_gateway.deliveries.rows import Queued
from skyway_gateway.deliveries.states import (
    SETTLED_PACKAGE_STATES,
    UNDER_WAY_STATES,
    may_follow,
)
from skyway_gateway.tables import custody, deliveries, missions, packages

# Statements of every delivery are made once: to make one takes as long as to run it.

_THIS: Final = deliveries.c.delivery_id == bindparam("this")
_LOCKED: Final = select(deliveries).where(_THIS).with_for_update()
#: What is written besides `save` and shows in a delivery makes a version of its own.
NEXT_VERSION: Final = {"version": deliveries.c.version + 1}
_PACKAGES: Final = (
    select(packages).where(among(packages.c.delivery_id, "ids")).order_by(packages.c.number)
)
#: A refused mission was never flown, and is told in `refusals`.
_MISSIONS: Final = (
    select(missions.c.delivery_id, missions.c.state, missions.c.body)
    .where(among(missions.c.delivery_id, "ids"), missions.c.state != "REFUSED")
    .order_by(missions.c.attempt, missions.c.trip)
)
#: What is told by the next report of a mission, or by none.
_IS_NEXT: Final = or_(
    bindparam("reported", type_=Text).is_(None),
    exists().where(
        missions.c.mission_id == bindparam("reported", type_=Text),
        missions.c.report_seq == bindparam("seq_before", type_=Integer),
    ),
)


@cache
def _saving(columns: tuple[str, ...]) -> ReturningUpdate[str]:
    """How these columns of a delivery are written, unless it was written since it was read.

    A report's place is looked for before the row is locked. That will do: who takes a report
    writes the delivery's row, too.
    """
    return (
        update(deliveries)
        .where(_THIS, deliveries.c.version == bindparam("version_before"), _IS_NEXT)
        .values({name: bindparam(f"now_{name}") for name in columns})
        .returning(deliveries.c.delivery_id)
    )


def _links_of(moved: FromClause) -> Select[*tuple[Any, ...]]:
    """The next link of each moved package's chain: whose it is now, under the number in its row."""
    return select(
        moved.c.delivery_id,
        moved.c.package_id,
        moved.c.custody_seq.label("seq"),
        moved.c.custodian_kind,
        moved.c.custodian_id,
        bindparam("moved_ms", type_=BigInteger).label("at_ms"),
    ).where(
        moved.c.delivery_id == bindparam("moved_of", type_=Text),
        among(moved.c.package_id, "moved"),
    )


_HAND_OVER: Final = Consequence(custody, packages, _links_of)
_REPORTED: Final = select(missions.c.report_seq).where(missions.c.mission_id == bindparam("this"))


def add(tx: Tx, queued: Queued, *, claim: Mapping[str, object]) -> None:
    """Keep a new delivery: from now on it is in the queue, and its packages are in custody."""
    delivery = queued.delivery
    tx.add(deliveries, [{**rows.new_delivery(queued), **claim}])
    tx.add(packages, rows.new_packages(delivery))
    tx.add(custody, [rows.first_custody_row(delivery, each) for each in delivery.packages])


async def note_reasons(tx: Tx, delivery_id: DeliveryId, reasons: Sequence[ProviderReason]) -> None:
    """Keep why the packages that wait are about to be given up."""
    values = {"reasons": rows.reasons_text(reasons), **NEXT_VERSION}
    this = and_(deliveries.c.delivery_id == delivery_id, deliveries.c.is_queued)
    await tx.execute(update(deliveries).where(this).values(values))


async def note_cancelling(tx: Tx, delivery_id: DeliveryId, *, reason: str) -> None:
    """Keep that all of a delivery that still can be stopped is to be."""
    values = {"cancel_reason": reason, **NEXT_VERSION}
    this = deliveries.c.delivery_id == delivery_id
    await tx.execute(update(deliveries).where(this).values(values))


async def lock(tx: Tx, delivery_id: DeliveryId) -> Known:
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
    return rows.known_of(found[0], delivery)


def save(
    tx: Tx,
    before: Known,
    after: Known,
    *,
    report: MissionReport | None,
    give_up_at: datetime | None,
) -> None:
    """Write what changed of a delivery, by the next report of a mission or by something else.

    All of it is written with the delivery's row, or nothing, and the block ends with Outdated: it
    was written since it was `before`, or the report is not the mission's next. The row comes
    first, as with `lock`, so that nobody waits in a circle.
    """
    old, new = before.delivery, after.delivery
    if not may_follow(new.state, old.state):
        raise RuntimeError(f"a delivery never goes from {old.state} to {new.state}")
    values = rows.changing(after)
    if (old.attempt, old.is_queued) != (new.attempt, new.is_queued):
        # What is to be booked is another thing now, to be looked at at once.
        values |= {"next_try_wall_ms": 0, **FREE}
    if give_up_at is not None:
        values["give_up_ms"] = moment_to_ms(give_up_at)
    expected = {
        "this": old.delivery_id,
        "version_before": before.version,
        "reported": report and report.mission_id,
        "seq_before": report and report.seq - 1,
    }
    now = {f"now_{name}": value for name, value in values.items()}
    tx.only_if(_saving(tuple(values)), {**expected, **now}, otherwise=Outdated())
    _save_packages(tx, old, new)
    _save_missions(tx, old.missions, new.missions, report)


def _save_packages(tx: Tx, before: Delivery, after: Delivery) -> None:
    pairs = [(old, new) for old, new in zip(before.packages, after.packages, strict=True)]
    changed = [(old, new) for old, new in pairs if new != old]
    moved = [new.package_id for old, new in changed if new.custodian != old.custodian]
    new_values = [
        {
            "package_id": new.package_id,
            "custody_seq": int(new.package_id in moved),
            **rows.package_values(new),
        }
        for _, new in changed
    ]
    this = {"delivery_id": after.delivery_id}
    tx.change(packages, this, new_values, key="package_id", counted=["custody_seq"])
    if moved:
        at_ms = moment_to_ms(after.updated_at)
        values = {"moved_of": after.delivery_id, "moved": moved, "moved_ms": at_ms}
        tx.follow_up(_HAND_OVER, values)


def _save_missions(
    tx: Tx,
    before: Sequence[FlownMission],
    after: Sequence[FlownMission],
    report: MissionReport | None,
) -> None:
    known = {mission.mission_id: mission for mission in before}
    new = [mission for mission in after if mission.mission_id not in known]
    tx.add(missions, [rows.mission_row(mission) for mission in new])
    changed = {
        mission.mission_id: rows.mission_changes(known[mission.mission_id], mission)
        for mission in after
        if mission != known.get(mission.mission_id, mission)
    }
    if report is not None:
        told = changed.get(report.mission_id, {})
        changed[report.mission_id] = {**told, **rows.reported(report)}
    for mission_id, values in changed.items():
        this = {"mission_id": mission_id}
        tx.change(missions, this, [{**this, **values}], key="mission_id")


async def last_report(tx: Tx, mission_id: MissionId) -> int | None:
    """The number of a mission's last report; None for a mission that is not known yet."""
    found: int | None = (await tx.execute(_REPORTED, {"this": mission_id})).scalar()
    return found


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
    # Most that is booked or cancelled early was never booked before: there is nothing to look for.
    booked = [row.delivery_id for row in found if row.state != "REQUESTED" or row.attempt > 1]
    for row in await connection.execute(_MISSIONS, {"ids": booked}) if booked else ():
        flown[row.delivery_id].append(rows.mission_of(row))
    return [rows.delivery_of(row, packed[row.delivery_id], flown[row.delivery_id]) for row in found]
