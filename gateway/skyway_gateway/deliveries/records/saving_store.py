"""The SQL by which deliveries are added and changed, with their packages, custody and missions.

Any, for columns: they are of every type.
"""

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
from sqlalchemy.sql.dml import ReturningUpdate

from skyway.contracts.mission import MissionReport
from skyway.runtime.sql.among import among
from skyway.runtime.sql.claims import FREE
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.declared import Consequence
from skyway.units import moment_to_ms
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, FlownMission
from skyway_gateway.deliveries.lifecycle.states import may_follow
from skyway_gateway.deliveries.records.delivery_rows import (
    changing,
    first_custody_row,
    mission_changes,
    mission_row,
    new_delivery,
    new_packages,
    package_values,
    reported,
)
from skyway_gateway.deliveries.records.stored_delivery import Known, Outdated, Queued
from skyway_gateway.tables import custody, deliveries, missions, packages

# Statements of every delivery are made once: to make one takes as long as to run it.

_THIS: Final = deliveries.c.delivery_id == bindparam("this")
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


def add(tx: Tx, queued: Queued, *, claim: Mapping[str, object]) -> None:
    """Keep a new delivery: from now on it is in the queue, and its packages are in custody."""
    delivery = queued.delivery
    tx.add(deliveries, [{**new_delivery(queued), **claim}])
    tx.add(packages, new_packages(delivery))
    tx.add(custody, [first_custody_row(delivery, each) for each in delivery.packages])


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
    values = changing(after)
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
            **package_values(new),
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
    tx.add(missions, [mission_row(mission) for mission in new])
    changed = {
        mission.mission_id: mission_changes(known[mission.mission_id], mission)
        for mission in after
        if mission != known.get(mission.mission_id, mission)
    }
    if report is not None:
        told = changed.get(report.mission_id, {})
        changed[report.mission_id] = {**told, **reported(report)}
    for mission_id, values in changed.items():
        this = {"mission_id": mission_id}
        tx.change(missions, this, [{**this, **values}], key="mission_id")
