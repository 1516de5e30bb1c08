"""The SQL of deliveries with their packages, custody and missions.

Columns are typed as Any, since they have every type.
"""

import asyncio
from collections import defaultdict
from collections.abc import Mapping, Sequence
from datetime import datetime
from functools import cache
from typing import Any, Final

from sqlalchemy import (
    BigInteger,
    FromClause,
    Integer,
    Select,
    Text,
    bindparam,
    exists,
    or_,
    select,
    update,
)
from sqlalchemy.ext.asyncio import AsyncConnection
from sqlalchemy.sql.dml import ReturningUpdate

from skyway.contracts.mission_reports import MissionReport
from skyway.ids import DeliveryId, MissionId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.sql.bulk_write import DerivedRows
from skyway.runtime.sql.claims import FREE
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway.units import moment_to_ms
from skyway_gateway.access.store import owned
from skyway_gateway.deliveries.lifecycle.delivery import (
    SETTLED_PACKAGE_STATES,
    UNDER_WAY_STATES,
    Delivery,
    DeliveryState,
    PackageStatus,
    may_follow,
)
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission
from skyway_gateway.deliveries.records.delivery_rows import (
    Outdated,
    QueuedDelivery,
    StoredDelivery,
    changing,
    delivery_of,
    first_custody_row,
    mission_changes,
    mission_of,
    mission_row,
    new_delivery,
    new_packages,
    package_of,
    package_values,
    reported,
    request_values,
    stored_of,
)
from skyway_gateway.delivery_tables import custody, deliveries, is_live_row, missions, packages

# Statements that every delivery runs are built once: building one takes as long as running it.

#: Deliveries of a list that are read in one step of the event loop, in about 1 ms.
_READ_TOGETHER: Final = 5

_ONE: Final = select(deliveries).where(deliveries.c.delivery_id == bindparam("this"))
_LOCKED: Final = _ONE.with_for_update()
#: A delivery in these states was never booked, unless it has a second attempt.
_UNBOOKED: Final[frozenset[DeliveryState]] = frozenset({"SCHEDULED", "REQUESTED"})
#: Each visible change of a delivery that `save` does not write counts as a version.
NEXT_VERSION: Final = {"version": deliveries.c.version + 1}
_PACKAGES: Final = (
    select(packages).where(in_list(packages.c.delivery_id, "ids")).order_by(packages.c.number)
)
#: Refused missions were never flown; `refusals` lists them. A mission whose customer cancelled it
#: before its drone refused it has its charge.
_MISSIONS: Final = (
    select(missions.c.delivery_id, missions.c.state, missions.c.body)
    .where(
        in_list(missions.c.delivery_id, "ids"),
        or_(missions.c.state != "REFUSED", missions.c.charged_amount.is_not(None)),
    )
    .order_by(missions.c.attempt, missions.c.trip)
)
_REPORTED: Final = select(missions.c.report_seq).where(missions.c.mission_id == bindparam("this"))
_THIS: Final = deliveries.c.delivery_id == bindparam("this")
#: True when the change comes from the next report of a mission, or from no report.
_IS_NEXT: Final = or_(
    bindparam("reported", type_=Text).is_(None),
    exists().where(
        missions.c.mission_id == bindparam("reported", type_=Text),
        missions.c.report_seq == bindparam("seq_before", type_=Integer),
    ),
)


async def lock(tx: Tx, delivery_id: DeliveryId) -> StoredDelivery:
    """A delivery, locked: no other transaction changes it until this one ends.

    Raises
    ------
    NotFound
        There is no such delivery.
    """
    return await read(tx.connection, delivery_id, query=_LOCKED)


async def read(
    connection: AsyncConnection, delivery_id: DeliveryId, *, query: Select[Any] = _ONE
) -> StoredDelivery:
    """A delivery, not locked; its parts may be newer than its version. Raises as `lock` does."""
    found = (await connection.execute(query, {"this": delivery_id})).all()
    if not found:
        raise NotFound("delivery", delivery_id)
    [delivery] = await with_parts(connection, found)
    return stored_of(found[0], delivery)


async def one_of(connection: AsyncConnection, caller: Caller, delivery_id: DeliveryId) -> Delivery:
    """The caller's own delivery.

    Raises
    ------
    NotFound
        There is no such delivery, or it is not the caller's.
    """
    found = await _own_row(connection, caller, delivery_id, select(deliveries))
    [delivery] = await with_parts(connection, [found])
    return delivery


async def require_own(connection: AsyncConnection, caller: Caller, delivery_id: DeliveryId) -> None:
    """Check that there is such a delivery of the caller's.

    Raises
    ------
    NotFound
        There is no such delivery, or it is not the caller's.
    """
    await _own_row(connection, caller, delivery_id, select(deliveries.c.delivery_id))


async def _own_row(
    connection: AsyncConnection, caller: Caller, delivery_id: DeliveryId, columns: Select[Any]
) -> AnyRow:
    statement = columns.where(
        deliveries.c.delivery_id == delivery_id, owned(caller, deliveries.c.customer_id)
    )
    found: AnyRow | None = (await connection.execute(statement)).first()
    if found is None:
        raise NotFound("delivery", delivery_id)
    return found


async def last_report(tx: Tx, mission_id: MissionId) -> int | None:
    """The number of a mission's last report; None for a mission that is not stored yet."""
    found: int | None = (await tx.execute(_REPORTED, {"this": mission_id})).scalar()
    return found


async def with_parts(connection: AsyncConnection, found: Sequence[AnyRow]) -> Sequence[Delivery]:
    """The deliveries of these rows, with their packages and missions, in the same order."""
    every: list[Delivery] = []
    for first in range(0, len(found), _READ_TOGETHER):
        if first:
            await asyncio.sleep(0)  # other callers go on between the parts of a long list
        every += await _few_with_parts(connection, found[first : first + _READ_TOGETHER])
    return every


async def _few_with_parts(
    connection: AsyncConnection, found: Sequence[AnyRow]
) -> Sequence[Delivery]:
    ids = [row.delivery_id for row in found]
    packed: dict[str, list[PackageStatus]] = defaultdict(list)
    for row in await connection.execute(_PACKAGES, {"ids": ids}):
        packed[row.delivery_id].append(package_of(row))
    flown: dict[str, list[FlownMission]] = defaultdict(list)
    # A delivery that was never booked has no missions to look for.
    booked = [row.delivery_id for row in found if row.state not in _UNBOOKED or row.attempt > 1]
    for row in await connection.execute(_MISSIONS, {"ids": booked}) if booked else ():
        flown[row.delivery_id].append(mission_of(row))
    return [delivery_of(row, packed[row.delivery_id], flown[row.delivery_id]) for row in found]


async def note_cancelling(tx: Tx, delivery_id: DeliveryId, *, reason: str) -> None:
    """Store that the whole delivery is to be cancelled, before anything is stopped."""
    values = {"cancel_reason": reason, **NEXT_VERSION}
    this = deliveries.c.delivery_id == delivery_id
    await tx.execute(update(deliveries).where(this).values(values))


async def overdue(
    connection: AsyncConnection, *, before: datetime, limit: int
) -> Sequence[DeliveryId]:
    """Deliveries without the delayed flag that have a package with an ETA before this moment.

    Test deliveries are not overdue: the sandbox plays them faster than their plans.
    """
    is_overdue = exists().where(
        packages.c.delivery_id == deliveries.c.delivery_id,
        packages.c.eta_ms < moment_to_ms(before),
        packages.c.state.not_in(SETTLED_PACKAGE_STATES),
    )
    statement = select(deliveries.c.delivery_id).where(
        deliveries.c.state.in_(UNDER_WAY_STATES),
        ~deliveries.c.is_delayed,
        is_overdue,
        is_live_row(deliveries.c.customer_id),
    )
    found = await connection.execute(statement.order_by(deliveries.c.delivery_id).limit(limit))
    return [DeliveryId(delivery_id) for delivery_id in found.scalars()]


@cache
def _saving(columns: tuple[str, ...]) -> ReturningUpdate[str]:
    """The statement that writes these columns, unless the delivery was written after it was read.

    It checks the report's number before it locks the row. That is safe, because each applied report
    also writes the delivery's row.
    """
    return (
        update(deliveries)
        .where(_THIS, deliveries.c.version == bindparam("version_before"), _IS_NEXT)
        .values({name: bindparam(f"now_{name}") for name in columns})
        .returning(deliveries.c.delivery_id)
    )


def _links_of(moved: FromClause) -> Select[*tuple[Any, ...]]:
    """The next custody row of each moved package: its new custodian and the new number."""
    return select(
        moved.c.delivery_id,
        moved.c.package_id,
        moved.c.custody_seq.label("seq"),
        moved.c.custodian_kind,
        moved.c.custodian_id,
        bindparam("moved_ms", type_=BigInteger).label("at_ms"),
    ).where(
        moved.c.delivery_id == bindparam("moved_of", type_=Text),
        in_list(moved.c.package_id, "moved"),
    )


_HAND_OVER: Final = DerivedRows(custody, packages, _links_of)


def add(tx: Tx, queued: QueuedDelivery, *, claim: Mapping[str, object]) -> None:
    """Add a new delivery: it is queued for booking, and the pickup has custody of its packages."""
    delivery = queued.delivery
    tx.add(deliveries, [{**new_delivery(queued), **claim}])
    tx.add(packages, new_packages(delivery))
    tx.add(custody, [first_custody_row(delivery, each) for each in delivery.packages])


def save(
    tx: Tx,
    before: StoredDelivery,
    after: StoredDelivery,
    *,
    report: MissionReport | None,
    give_up_at: datetime | None,
) -> None:
    """Write what changed between two versions of a delivery.

    Either everything is written, or nothing, and the transaction block ends with Outdated: somebody
    wrote the delivery after `before` was read, or the report is not the mission's next one. The
    delivery's row is written first, as `lock` does, so that transactions cannot deadlock.
    """
    old, new = before.delivery, after.delivery
    if not may_follow(new.state, old.state):
        raise RuntimeError(f"a delivery never goes from {old.state} to {new.state}")
    values = changing(after)
    if (old.attempt, old.is_queued) != (new.attempt, new.is_queued):
        # What has to be booked has changed: look at it immediately.
        values |= {"next_try_wall_ms": 0, "waits_since_ms": None, "asked_wall_ms": None, **FREE}
    if new.request is not old.request:
        values |= request_values(new)
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
            **package_values(new),
        }
        for _, new in changed
    ]
    this = {"delivery_id": after.delivery_id}
    tx.update_rows(packages, this, new_values, key="package_id", increments=["custody_seq"])
    if moved:
        at_ms = moment_to_ms(after.updated_at)
        values = {"moved_of": after.delivery_id, "moved": moved, "moved_ms": at_ms}
        tx.add_derived(_HAND_OVER, values)


def _save_missions(
    tx: Tx,
    before: Sequence[FlownMission],
    after: Sequence[FlownMission],
    report: MissionReport | None,
) -> None:
    stored = {mission.mission_id: mission for mission in before}
    new = [mission for mission in after if mission.mission_id not in stored]
    tx.add(missions, [mission_row(mission) for mission in new])
    changed = {
        mission.mission_id: mission_changes(stored[mission.mission_id], mission)
        for mission in after
        if mission != stored.get(mission.mission_id, mission)
    }
    if report is not None:
        values = changed.get(report.mission_id, {})
        changed[report.mission_id] = {**values, **reported(report)}
    for mission_id, values in changed.items():
        this = {"mission_id": mission_id}
        tx.update_rows(missions, this, [{**this, **values}], key="mission_id")
