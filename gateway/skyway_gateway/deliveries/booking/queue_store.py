"""The SQL of the queue of deliveries with packages that wait: claims, and waiting for a drone."""

from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Final

from sqlalchemy import BigInteger, Text, and_, bindparam, case, func, or_, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.candidate import ProviderReason
from skyway.ids import DeliveryId, NetworkId
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.claims import FREE, NOW_MS, Claiming, claim_values
from skyway.runtime.sql.database import Database, Tx
from skyway.runtime.sql.in_list import in_list
from skyway.units import moment_to_ms
from skyway_gateway.deliveries.records.delivery_rows import (
    DeliveryCache,
    QueuedDelivery,
    Values,
    queued_of,
    reasons_text,
    stored_of,
)
from skyway_gateway.deliveries.records.delivery_store import NEXT_VERSION, with_parts
from skyway_gateway.delivery_tables import deliveries

#: How long a claim holds unless it is renewed, seconds of wall time. After that, another process
#: books what a killed process had claimed. If two processes book the same delivery, composition
#: gives both the same answer: a claim that ends too early costs a question, not a second drone.
_LEASE_S: Final = 3.0

#: How many waiting requests of a network one change wakes. A change frees one drone as a rule, and
#: the first of them may not fit it. The others are tried again by and by.
_WOKEN: Final = 4

# Statements that every delivery runs are built once: building one takes as long as running it.

_CLAIMING: Final = Claiming.of(
    deliveries,
    where=and_(deliveries.c.is_queued, deliveries.c.next_try_wall_ms <= NOW_MS),
    # A lost answer comes first: its mission may fly, and the customer does not know. New requests
    # and woken ones are due at 0: they are tried in the order of class and asking.
    order_by=[
        deliveries.c.asked_wall_ms.asc().nulls_last(),
        deliveries.c.next_try_wall_ms,
        deliveries.c.queue_rank,
        deliveries.c.created_ms,
        deliveries.c.delivery_id,
    ],
)
#: Rows are locked in the order of their ids, as `wake_first` does.
_ours = (
    select(deliveries.c.delivery_id)
    .where(
        in_list(deliveries.c.delivery_id, "held"),
        deliveries.c.claimed_by == bindparam("claimant", type_=Text),
    )
    .order_by(deliveries.c.delivery_id)
    .with_for_update()
    .cte("ours")
)
_HOLDING: Final = (
    update(deliveries)
    .where(deliveries.c.delivery_id.in_(select(_ours.c.delivery_id)))
    .values(claimed_until_ms=bindparam("until_ms", type_=BigInteger))
)

_waits = deliveries.c.waits_since_ms.is_not(None)

#: A request that waits for a drone has its answer: the reasons why it waits. One that only stands
#: behind such requests has none yet.
_UNANSWERED: Final = select(func.count()).where(
    deliveries.c.is_queued,
    or_(
        deliveries.c.asked_wall_ms.is_not(None),
        and_(
            deliveries.c.next_try_wall_ms == 0,
            or_(~_waits, deliveries.c.reasons == reasons_text(())),
        ),
    ),
)

_place = func.row_number().over(
    partition_by=deliveries.c.network_id,
    order_by=(deliveries.c.queue_rank, deliveries.c.created_ms, deliveries.c.delivery_id),
)

_WAITING_NETWORKS: Final = select(deliveries.c.network_id).where(_waits).distinct()


def held_by(claimant: str, clock: FleetClock) -> Values:
    """The columns of a new row that its process claims immediately."""
    return {"claimed_by": claimant, "claimed_until_ms": _lease_end_ms(clock)}


async def claim_queued(
    db: Database, *, limit: int, claimant: str, clock: FleetClock, cache: DeliveryCache
) -> Sequence[QueuedDelivery]:
    """Claim deliveries whose booking is due, the longest waiting first."""
    values = claim_values(limit=limit, claimant=claimant, lease_s=_LEASE_S, clock=clock)
    due = _CLAIMING.in_order(await db.write_alone(_CLAIMING.statement, values))
    found = cache.matching((row.delivery_id, row.version) for row in due)
    unknown = [row for row in due if row.delivery_id not in found]
    if unknown:
        # Parts that change meanwhile are of a later version: nothing is written from these.
        async with db.read() as connection:
            for row, delivery in zip(unknown, await with_parts(connection, unknown), strict=True):
                found[delivery.delivery_id] = stored_of(row, delivery)
    return [queued_of(row, found[row.delivery_id]) for row in due]


async def read_queued(db: Database, delivery_id: DeliveryId) -> QueuedDelivery | None:
    """A delivery with packages that wait, not claimed; None if no package waits."""
    this = select(deliveries).where(deliveries.c.delivery_id == delivery_id, deliveries.c.is_queued)
    async with db.read() as connection:
        found = (await connection.execute(this)).all()
        parts = await with_parts(connection, found)
    return queued_of(found[0], stored_of(found[0], parts[0])) if found else None


async def hold(
    db: Database, held: Collection[DeliveryId], *, claimant: str, clock: FleetClock
) -> None:
    """Renew the claimant's claims of these deliveries; claims that others took over stay theirs."""
    values = {"held": [*held], "claimant": claimant, "until_ms": _lease_end_ms(clock)}
    await db.write_alone(_HOLDING, values)


async def scheduled_until(
    connection: AsyncConnection, until: datetime, *, limit: int
) -> Sequence[DeliveryId]:
    """SCHEDULED deliveries with a pickup until this fleet moment, or which are being cancelled."""
    is_due = or_(
        deliveries.c.earliest_pickup_ms <= moment_to_ms(until),
        deliveries.c.cancel_reason.is_not(None),
    )
    found = await connection.execute(
        select(deliveries.c.delivery_id)
        .where(deliveries.c.state == "SCHEDULED", is_due)
        .order_by(deliveries.c.earliest_pickup_ms, deliveries.c.delivery_id)
        .limit(limit)
    )
    return [DeliveryId(delivery_id) for delivery_id in found.scalars()]


async def free_claims(tx: Tx) -> None:
    """Free all claims. Only for SQLite, where all earlier claimants are dead at the start."""
    await tx.execute(update(deliveries).where(deliveries.c.is_queued).values(FREE))


async def try_later(
    tx: Tx,
    delivery_id: DeliveryId,
    *,
    next_try_at: datetime,
    reasons: Sequence[ProviderReason] | None,
    give_up_at: datetime | None = None,
    asked_at: datetime | None = None,
) -> None:
    """Leave a delivery in the queue until a moment of wall time; None keeps what is stored.

    `give_up_at` replaces the moment of fleet time at which booking gives up. `asked_at` is since
    when an answer of composition is missing, wall time.
    """
    values: dict[str, object] = {"next_try_wall_ms": moment_to_ms(next_try_at), **FREE}
    if asked_at is not None:
        values["asked_wall_ms"] = moment_to_ms(asked_at)
    if give_up_at is not None:
        values["give_up_ms"] = moment_to_ms(give_up_at)
    if reasons is not None:
        values |= {"reasons": reasons_text(reasons), **NEXT_VERSION}
    this = and_(deliveries.c.delivery_id == delivery_id, deliveries.c.is_queued)
    await tx.execute(update(deliveries).where(this).values(values))


async def note_reasons(tx: Tx, delivery_id: DeliveryId, reasons: Sequence[ProviderReason]) -> None:
    """Store the reasons for giving up the packages that wait, before they are given up."""
    values = {"reasons": reasons_text(reasons), **NEXT_VERSION}
    this = and_(deliveries.c.delivery_id == delivery_id, deliveries.c.is_queued)
    await tx.execute(update(deliveries).where(this).values(values))


async def wait_longer(
    tx: Tx,
    queued: QueuedDelivery,
    *,
    now: datetime,
    next_try_at: datetime,
    reasons: Sequence[ProviderReason],
) -> None:
    """Leave a delivery in the queue because no drone is free.

    If something has woken it since it was claimed, it is tried again immediately. `now` is fleet
    time, `next_try_at` wall time.
    """
    is_as_claimed = deliveries.c.woken_wall_ms == queued.woken_wall_ms
    values = {
        "next_try_wall_ms": case((is_as_claimed, moment_to_ms(next_try_at)), else_=0),
        "waits_since_ms": func.coalesce(deliveries.c.waits_since_ms, moment_to_ms(now)),
        "reasons": reasons_text(reasons),
        "asked_wall_ms": None,
        **NEXT_VERSION,
        **FREE,
    }
    this = deliveries.c.delivery_id == queued.delivery.delivery_id
    await tx.execute(update(deliveries).where(this, deliveries.c.is_queued).values(values))


async def line_up(tx: Tx, queued: QueuedDelivery, *, now: datetime) -> None:
    """Let a new delivery wait behind those that wait already; it is due immediately."""
    values = {"waits_since_ms": moment_to_ms(now), "next_try_wall_ms": 0, **FREE}
    this = deliveries.c.delivery_id == queued.delivery.delivery_id
    await tx.execute(update(deliveries).where(this, deliveries.c.is_queued).values(values))


async def unanswered(db: Database) -> int:
    """How many requests nobody has tried to book yet, and how many answers are lost."""
    async with db.read() as connection:
        return int((await connection.execute(_UNANSWERED)).scalar_one())


async def waiting_networks(db: Database) -> frozenset[NetworkId | None]:
    """The networks in which requests wait; None stands for requests whose network is unknown."""
    async with db.read() as connection:
        return frozenset((await connection.execute(_WAITING_NETWORKS)).scalars())


async def wake_first(db: Database, network_id: NetworkId | None, *, wall_at: datetime) -> bool:
    """Try the first waiting requests of a network again; None means of every network.

    Returns whether there are any. Rows are locked in the order of their ids, as `hold` does, so
    that the two cannot wait for each other.
    """
    of_network = or_(deliveries.c.network_id == network_id, deliveries.c.network_id.is_(None))
    waiting = select(deliveries.c.delivery_id, _place.label("place")).where(_waits)
    if network_id is not None:
        waiting = waiting.where(of_network)
    placed = waiting.subquery()
    first = (
        select(deliveries.c.delivery_id)
        .where(
            deliveries.c.delivery_id.in_(
                select(placed.c.delivery_id).where(placed.c.place <= _WOKEN)
            )
        )
        .order_by(deliveries.c.delivery_id)
        .with_for_update()
        .cte("first")
    )
    now_ms = bindparam("now_ms", type_=BigInteger)
    statement = (
        update(deliveries)
        .where(deliveries.c.delivery_id.in_(select(first.c.delivery_id)), _waits)
        .values(next_try_wall_ms=0, woken_wall_ms=now_ms)
        .returning(deliveries.c.delivery_id)
    )
    return bool(await db.write_alone(statement, {NOW_MS.key: moment_to_ms(wall_at)}))


def _lease_end_ms(clock: FleetClock) -> int:
    return moment_to_ms(clock.wall_now()) + int(_LEASE_S * 1000)
